// Forward kinematics: poses of all bodies from joint positions, in the letters of regressors.robot.robot.Joint.
import { Matrix4, Vector3 } from "three";

const rotation = new Matrix4();
const shift = new Matrix4();

// A body's fixed placement R, p of its joint in the frame of the body that carries it, as a matrix.
export function placement({ rotation: R, translation: p }) {
  return new Matrix4().set(
    R[0][0], R[0][1], R[0][2], p[0],
    R[1][0], R[1][1], R[1][2], p[1],
    R[2][0], R[2][1], R[2][2], p[2],
    0, 0, 0, 1,
  );
}

// Coordinate of a body's joint: row . q + offset.
function coordinate(body, q) {
  return body.row.reduce((sum, factor, k) => sum + factor * q[k], body.offset);
}

// Writes the pose of every body in the base frame into `poses`, whose entry 0 is the base; parents come first.
export function setPoses(bodies, q, poses) {
  bodies.forEach((body, k) => {
    const s = coordinate(body, q);
    const pose = poses[k + 1].multiplyMatrices(poses[body.parent], body.placement);
    if (body.kind === "revolute") {
      pose.multiply(rotation.makeRotationAxis(body.direction, s));
    } else {
      const d = body.direction;
      pose.multiply(shift.makeTranslation(d.x * s, d.y * s, d.z * s));
    }
  });
}

// Bodies as stored in the page, with what the poses need.
export function prepared(bodies) {
  return bodies.map((body) => ({ ...body, placement: placement(body), direction: new Vector3(...body.axis) }));
}

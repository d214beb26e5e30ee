// What is seen: the robot's links as meshes, capsules or lines through its frames, and the objects around it.
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, CylinderGeometry, Group, Matrix4, Mesh,
  MeshStandardMaterial, PlaneGeometry, Quaternion, SphereGeometry, Vector3,
} from "three";

const UP = new Vector3(0, 1, 0); // along the geometries of three.js
const SIDES = 20;

export function material(color, opacity = 1) {
  return new MeshStandardMaterial({
    color, opacity, transparent: opacity < 1, roughness: 0.75, metalness: 0.05, flatShading: false,
  });
}

// A cylinder with round ends, or a sphere where both ends are one point.
export function capsule({ from, to, radius }, look) {
  const [start, end] = [new Vector3(...from), new Vector3(...to)];
  const line = end.clone().sub(start);
  const length = line.length();
  const geometry = length > 0
    ? new CapsuleGeometry(radius, length, 8, SIDES) : new SphereGeometry(radius, SIDES, SIDES / 2);
  const mesh = new Mesh(geometry, look);
  if (length > 0) mesh.quaternion.setFromUnitVectors(UP, line.normalize());
  mesh.position.copy(start).add(end).multiplyScalar(0.5);
  return mesh;
}

// Numbers of a typed array that is stored as base64.
function numbers(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

export function triangles({ corners, faces, scale, origin }, look) {
  const short = numbers(corners, Uint16Array);
  const values = new Float32Array(short.length);
  for (let k = 0; k < short.length; k += 1) values[k] = origin[k % 3] + scale * short[k];
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(values, 3));
  geometry.setIndex(new BufferAttribute(numbers(faces, Uint16Array), 1));
  const flat = geometry.toNonIndexed(); // edges stay sharp
  flat.computeVertexNormals();
  return new Mesh(flat, look);
}

// The joint of a body, as a short cylinder about its axis or a cuboid along it.
export function joint(body, size, look) {
  const geometry = body.kind === "revolute"
    ? new CylinderGeometry(size, size, 2.4 * size, SIDES) : new BoxGeometry(1.5 * size, 3 * size, 1.5 * size);
  const mesh = new Mesh(geometry, look);
  mesh.quaternion.setFromUnitVectors(UP, new Vector3(...body.axis));
  return mesh;
}

function box({ centre, size, rpy }, look) {
  const mesh = new Mesh(new BoxGeometry(...size), look);
  mesh.position.set(...centre);
  mesh.rotation.set(...rpy, "ZYX");
  return mesh;
}

// The surface of a half-space, as a square about the base.
function plane({ normal, offset }, look, reach) {
  const group = new Group();
  const surface = new Mesh(new PlaneGeometry(2 * reach, 2 * reach), look);
  const up = new Vector3(...normal);
  surface.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), up));
  surface.position.copy(up).multiplyScalar(offset);
  group.add(surface);
  return group;
}

export function object(each, look, reach) {
  if (each.kind === "box") return box(each, look);
  if (each.kind === "plane") return plane(each, look, reach);
  return capsule(each, look);
}

// Largest distance of a body's pieces from its own frame.
export function reachOf(mesh) {
  mesh.geometry.computeBoundingSphere();
  const { center, radius } = mesh.geometry.boundingSphere;
  return center.clone().applyMatrix4(new Matrix4().compose(mesh.position, mesh.quaternion, mesh.scale)).length() + radius;
}

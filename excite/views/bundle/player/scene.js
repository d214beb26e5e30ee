// The scene of one player: it is drawn when something changed, and not otherwise.
import {
  Box3, BufferGeometry, Color, DirectionalLight, GridHelper, Group, HemisphereLight, Line, LineBasicMaterial, Matrix4, Mesh,
  CylinderGeometry, MeshBasicMaterial, Plane, Scene, Vector3, WebGLRenderer,
} from "three";
import { Orbit } from "./camera.js";
import { capsule, joint, material, object, reachOf, triangles } from "./bodies.js";
import { positions } from "./motion.js";
import { setPoses } from "./kinematics.js";

const UP = new Vector3(0, 1, 0);
const FILL = 0.9; // of the ball around the motion, that is in view: its corners are empty
const LINE = 0.28; // radius of a line through the frames, of a joint's
const DEEP = 1e-3; // m below the ground, from which on it is marked
const RESTS = 1e-6; // m that the frame of a body moves which stands on the ground

export class View {
  constructor(stage, data) {
    this.stage = stage;
    this.data = data;
    this.scene = new Scene();
    this.poses = [new Matrix4(), ...data.bodies.map(() => new Matrix4())];
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true }); // kept, so that it prints
    this.canvas = this.renderer.domElement;
    stage.append(this.canvas);
    this.orbit = new Orbit(stage, () => this.ask());
    const reach = this.build();
    this.light(reach);
    new ResizeObserver(() => this.resize()).observe(stage);
    this.colours();
    this.resize();
  }

  colours() {
    const of = (name) => getComputedStyle(this.stage).getPropertyValue(name).trim();
    this.palette = { ok: new Color(of("--link")), near: new Color(of("--near")), over: new Color(of("--over")) };
    this.scene.background = new Color(of("--stage"));
    this.looks.forEach((look) => look.color.copy(this.palette.ok));
    this.objectLooks.forEach((look) => look.color.set(of(look.opacity < 1 ? "--object" : "--ground")));
    this.below.color.set(of("--over"));
    this.path.color.set(of("--path"));
    this.grid.material.color.set(of("--grid"));
    this.ask();
  }

  light(reach) {
    this.scene.add(new HemisphereLight(0xffffff, 0x8a8f98, 1.9));
    const sun = new DirectionalLight(0xffffff, 1.7);
    sun.position.set(2 * reach, -1.5 * reach, 3 * reach);
    this.scene.add(sun);
  }

  build() {
    const { data } = this;
    this.groups = this.poses.map(() => new Group());
    this.groups.forEach((group) => {
      group.matrixAutoUpdate = false;
      this.scene.add(group);
    });
    const { traces, frames, rests } = this.places();
    const size = data.joint_size;
    this.looks = this.groups.map(() => material("#aab2bd"));
    this.path = new LineBasicMaterial({ color: "#56B4E9" });
    traces.forEach((trace) => this.scene.add(new Line(new BufferGeometry().setFromPoints(trace), this.path)));
    const width = this.addLinks(size);
    const all = [new Vector3(), ...traces.flat(), ...frames];
    const space = new Box3().setFromPoints(all).expandByScalar(Math.min(width, 4 * size));
    const extent = Math.max(...traces.flat().map((point) => point.length()), width);
    this.objectLooks = [];
    this.below = new MeshBasicMaterial({ transparent: true, opacity: 0.75, depthTest: false });
    const ground = data.objects.find((each) => each.kind === "plane");
    if (ground) {
      const normal = new Vector3(...ground.normal);
      this.deep = [new Plane(normal.negate(), ground.offset - DEEP)];
      this.standing = this.groups.filter((_, k) => rests[k]);
    }
    this.objects = new Map(data.objects.map((each) => [each.name, this.addObject(each, extent)]));
    this.grid = new GridHelper(2 * Math.ceil(extent), 4 * Math.ceil(extent));
    this.grid.rotation.x = Math.PI / 2;
    this.grid.material.transparent = true;
    this.grid.material.opacity = 0.35;
    this.grid.material.vertexColors = false;
    this.scene.add(this.grid);
    const centre = space.getCenter(new Vector3());
    const far = Math.max(...all.map((point) => point.distanceTo(centre))) + Math.min(width, 4 * size);
    this.orbit.frame(centre, FILL * far);
    return extent;
  }

  // Places of the tool, of each last link, and of all frames at every sample.
  places() {
    const tips = this.data.tips.map((tip) => this.poses[tip + 1]);
    const tool = new Vector3(...this.data.tool);
    const frames = [];
    const first = [];
    const rests = this.poses.map(() => true);
    const trace = this.data.time.map((t) => {
      setPoses(this.data.bodies, positions(this.data, t), this.poses);
      this.poses.forEach((pose, k) => {
        const place = new Vector3().setFromMatrixPosition(pose);
        frames.push(place);
        first[k] ??= place;
        rests[k] &&= place.distanceTo(first[k]) < RESTS;
      });
      return tips.map((tip) => tool.clone().applyMatrix4(tip));
    });
    return { traces: tips.map((_, k) => trace.map((points) => points[k])), frames, rests };
  }

  addLinks(size) {
    const { data } = this;
    let widest = 0;
    const add = (body, mesh) => {
      this.groups[body].add(mesh);
      widest = Math.max(widest, reachOf(mesh));
    };
    data.meshes.forEach((each) => add(each.body, triangles(each, this.looks[each.body])));
    data.capsules.forEach((each) => add(each.body, capsule(each, this.looks[each.body])));
    const drawn = new Set([...data.meshes, ...data.capsules].map((each) => each.body));
    data.bodies.forEach((body, k) => {
      if (drawn.size === 0) this.groups[k + 1].add(joint(body, size, this.looks[k + 1]));
      if (!drawn.has(body.parent)) this.addLine(body, size);
    });
    return widest;
  }

  // The line that leads to a joint from the frame before.
  addLine(body, size) {
    const to = new Vector3(...body.translation);
    const length = to.length();
    if (length === 0) return;
    const line = new Mesh(new CylinderGeometry(LINE * size, LINE * size, length, 12), this.looks[body.parent]);
    line.quaternion.setFromUnitVectors(UP, to.clone().normalize());
    line.position.copy(to).multiplyScalar(0.5);
    this.groups[body.parent].add(line);
  }

  addObject(each, extent) {
    const look = material("#E69F00", each.kind === "plane" ? 1 : 0.8);
    look.side = 2;
    Object.assign(look, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }); // behind the grid
    this.objectLooks.push(look);
    const made = object(each, look, 1.2 * extent);
    this.scene.add(made);
    this.solids = [...(this.solids ?? []), made];
    return look;
  }

  // Moves everything to joint positions, and colours bodies and objects by their state.
  show(q, states) {
    setPoses(this.data.bodies, q, this.poses);
    this.groups.forEach((group, k) => {
      group.matrix.copy(this.poses[k]);
      group.matrixWorldNeedsUpdate = true;
    });
    this.looks.forEach((look, k) => look.color.copy(this.palette[states.bodies.get(k) ?? "ok"]));
    this.ask();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.orbit.fit(width / height);
    this.ask();
  }

  // Draws at the next frame, once.
  ask() {
    if (this.asked || this.renderer === undefined) return;
    this.asked = true;
    requestAnimationFrame(() => this.draw());
  }

  // A copy in place of the canvas, whose last frame on the screen would be printed otherwise.
  copy() {
    const { width, height } = this.canvas;
    this.printed = Object.assign(document.createElement("canvas"), { width, height });
    this.printed.getContext("2d").drawImage(this.canvas, 0, 0);
    this.canvas.replaceWith(this.printed);
  }

  uncopy() {
    this.printed?.replaceWith(this.canvas);
  }

  draw() {
    this.asked = false;
    this.renderer.render(this.scene, this.orbit.camera);
    if (this.deep) this.mark();
  }

  // Draws what moves below the ground once more, through it.
  mark() {
    const hidden = [this.grid, ...this.solids, ...this.standing];
    const { background } = this.scene;
    hidden.forEach((each) => (each.visible = false));
    Object.assign(this.scene, { background: null, overrideMaterial: this.below });
    Object.assign(this.renderer, { autoClear: false, clippingPlanes: this.deep });
    this.renderer.render(this.scene, this.orbit.camera);
    Object.assign(this.renderer, { autoClear: true, clippingPlanes: [] });
    Object.assign(this.scene, { background, overrideMaterial: null });
    hidden.forEach((each) => (each.visible = true));
  }
}

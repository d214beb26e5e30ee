// The camera around a point: mouse, touch and keyboard turn it, move it nearer, and shift the point.
import { PerspectiveCamera, Vector3 } from "three";

const UP = new Vector3(0, 0, 1);
const HIGHEST = 1.55; // rad, just below the vertical

export class Orbit {
  constructor(element, onChange) {
    this.camera = new PerspectiveCamera(38, 1, 0.01, 200);
    this.camera.up.copy(UP);
    this.onChange = onChange;
    this.pointers = new Map();
    this.element = element;
    this.home = { azimuth: -0.9, height: 0.35, distance: 3, target: new Vector3() };
    this.reset();
    element.addEventListener("pointerdown", (event) => this.down(event));
    element.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) {
      element.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    element.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  // Looks at everything within `radius` of a point.
  frame(target, radius) {
    this.home.target.copy(target);
    this.radius = radius;
    this.fit(1);
    this.reset();
  }

  // Takes the shape of the view, width over height: a narrow one needs more distance.
  fit(aspect) {
    const before = this.home.distance;
    this.home.distance = Math.max(0.1, this.radius / Math.sin((this.camera.fov * Math.PI) / 360)) / Math.min(1, aspect);
    this.distance *= this.home.distance / before;
    Object.assign(this.camera, { aspect, near: this.home.distance / 200, far: this.home.distance * 40 });
    this.camera.updateProjectionMatrix();
    this.update();
  }

  reset() {
    this.azimuth = this.home.azimuth;
    this.height = this.home.height;
    this.distance = this.home.distance;
    this.target = this.home.target.clone();
    this.update();
  }

  turn(azimuth, height) {
    this.azimuth += azimuth;
    this.height = Math.min(HIGHEST, Math.max(-HIGHEST, this.height + height));
    this.update();
  }

  nearer(factor) {
    this.distance = Math.min(20 * this.home.distance, Math.max(0.05 * this.home.distance, this.distance * factor));
    this.update();
  }

  shift(x, y) {
    const size = this.distance * 0.0015;
    const right = new Vector3().setFromMatrixColumn(this.camera.matrix, 0).multiplyScalar(-x * size);
    const above = new Vector3().setFromMatrixColumn(this.camera.matrix, 1).multiplyScalar(y * size);
    this.target.add(right).add(above);
    this.update();
  }

  update() {
    const flat = this.distance * Math.cos(this.height);
    this.camera.position.set(
      this.target.x + flat * Math.cos(this.azimuth),
      this.target.y + flat * Math.sin(this.azimuth),
      this.target.z + this.distance * Math.sin(this.height),
    );
    this.camera.lookAt(this.target);
    this.camera.updateMatrix();
    this.onChange();
  }

  down(event) {
    this.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (before === undefined) return;
    const now = [event.clientX, event.clientY];
    const [x, y] = [now[0] - before[0], now[1] - before[1]];
    if (this.pointers.size === 2) this.pinch(event.pointerId, now);
    else if (event.shiftKey || event.buttons & 6) this.shift(x, y);
    else this.turn(-0.008 * x, 0.008 * y);
    this.pointers.set(event.pointerId, now);
  }

  pinch(id, now) {
    const [other] = [...this.pointers].filter(([key]) => key !== id).map(([, at]) => at);
    const before = this.pointers.get(id);
    const gap = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
    this.nearer(gap(before) / gap(now));
    this.shift((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
  }

  wheel(event) {
    if (!event.ctrlKey && document.activeElement !== this.element) return; // the page scrolls until it is chosen
    event.preventDefault();
    this.nearer(Math.exp(0.0012 * event.deltaY));
  }

  // True if the key was one of the camera's.
  key(event) {
    const step = 0.12;
    const actions = {
      ArrowLeft: () => this.turn(-step, 0),
      ArrowRight: () => this.turn(step, 0),
      ArrowUp: () => this.turn(0, step),
      ArrowDown: () => this.turn(0, -step),
      "+": () => this.nearer(0.9),
      "=": () => this.nearer(0.9),
      "-": () => this.nearer(1 / 0.9),
      "0": () => this.reset(),
    };
    if (!(event.key in actions)) return false;
    actions[event.key]();
    return true;
  }
}

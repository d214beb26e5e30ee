// Players of motions: every element .player of the page with the data of its motion.
import { Meters } from "./meters.js";
import { View } from "./scene.js";
import { positions } from "./motion.js";
import { prepared, setPoses } from "./kinematics.js";
import { Matrix4 } from "three";

const STEP = 0.05; // s, of the keys , and .

class Player {
  constructor(element) {
    const find = (name) => element.querySelector(`.${name}`);
    const data = JSON.parse(document.getElementById(element.dataset.motion).textContent);
    this.data = { ...data, bodies: prepared(data.bodies) };
    this.duration = data.time[data.time.length - 1];
    this.time = 0;
    this.speed = 1;
    this.poses = [new Matrix4(), ...data.bodies.map(() => new Matrix4())];
    this.stage = find("stage");
    [this.button, this.scrub, this.clock] = ["play", "scrub", "clock"].map(find);
    this.meters = new Meters(find("meters"), find("nearest"), data);
    this.listen(find("speed"), find("reset"));
    this.seek(0);
    this.whenSeen(() => this.show());
    window.addEventListener("beforeprint", () => {
      this.show();
      this.view?.copy();
    });
    window.addEventListener("afterprint", () => {
      this.view?.uncopy();
      this.show();
    });
  }

  // Draws the view, which is made when it is first needed, in the page's colours, now: what takes a picture of the page,
  // or prints it, does not wait for the next frame.
  show() {
    if (this.view === undefined) this.view = this.viewed();
    this.view?.resize();
    this.view?.colours();
    this.seek(this.time);
    this.view?.draw();
  }

  // What is on the screen at first is drawn before the page counts as loaded; the rest when it comes into view.
  whenSeen(begin) {
    const { top, bottom } = this.stage.getBoundingClientRect();
    if (top < window.innerHeight && bottom > 0) {
      begin();
      return;
    }
    const observer = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      setTimeout(begin);
    });
    observer.observe(this.stage);
  }

  // The 3D view; without WebGL the numbers move, and a sentence says why there is no picture.
  viewed() {
    try {
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show());
      return new View(this.stage, this.data);
    } catch (error) {
      this.stage.textContent = `The 3D view needs WebGL, which this browser does not offer (${error.message}).`;
      return null;
    }
  }

  listen(speed, reset) {
    this.button.addEventListener("click", () => this.toggle());
    this.scrub.addEventListener("input", () => {
      this.pause();
      this.seek(Number(this.scrub.value));
    });
    speed.addEventListener("change", () => {
      this.speed = Number(speed.value);
    });
    reset.addEventListener("click", () => this.view?.orbit.reset());
    this.stage.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const actions = {
      " ": () => this.toggle(),
      ",": () => this.seek(this.time - STEP),
      ".": () => this.seek(this.time + STEP),
      Home: () => this.seek(0),
      End: () => this.seek(this.duration),
    };
    if (event.key in actions) actions[event.key]();
    else if (!this.view?.orbit.key(event)) return;
    event.preventDefault();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.time >= this.duration) this.seek(0);
    this.playing = true;
    this.button.textContent = "Pause";
    let before;
    const frame = (now) => {
      if (!this.playing) return;
      if (before !== undefined) this.seek(this.time + (this.speed * (now - before)) / 1000);
      before = now;
      if (this.time >= this.duration) this.pause();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.playing = false;
    this.button.textContent = "Play";
  }

  seek(time) {
    this.time = Math.min(this.duration, Math.max(0, time));
    const states = this.meters.show(this.time);
    this.view?.show(positions(this.data, this.time), states);
    this.scrub.value = String(this.time);
    const segment = this.data.segments.find(({ end }) => this.time <= end) ?? this.data.segments.at(-1);
    const text = `${this.time.toFixed(2)} of ${this.duration.toFixed(2)} s, ${segment.name}`;
    this.clock.textContent = text;
    this.scrub.setAttribute("aria-valuetext", text);
  }

  // Pose of each body in the base frame at the present instant, row by row, by name.
  pose() {
    setPoses(this.data.bodies, positions(this.data, this.time), this.poses);
    return Object.fromEntries(
      this.data.bodies.map((body, k) => [body.name, this.poses[k + 1].clone().transpose().elements]),
    );
  }
}

window.exciteReport = { players: [...document.querySelectorAll(".player")].map((element) => new Player(element)) };

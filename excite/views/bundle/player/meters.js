// How near each limit is: a table with a bar per limit, and one sentence on the nearest one.
import { between } from "./motion.js";

const NEAR = 0.9; // of a limit, above which it is marked
const ORDER = [ // of the columns
  "position", "velocity", "acceleration", "jerk", "torque", "measured", "predicted", "tool", "distance",
];
const MARKS = { ok: "", near: "near", over: "BROKEN" };
const EXACT = 1e-4; // of the bound: values in the page are rounded

// Fraction used of the distance from the middle of the range to its edge, as in design.json; 1 at the bound where
// there is only one: of a distance the clearance over it, else by its margin over the largest size.
function used({ quantity, lower, upper, most }, value) {
  if (lower !== null && upper !== null) return Math.abs(value - (lower + upper) / 2) / ((upper - lower) / 2);
  if (quantity === "distance") return value > 0 ? lower / value : 2;
  const [bound, margin] = lower !== null ? [lower, value - lower] : [upper, upper - value];
  return 1 - margin / Math.max(Math.abs(bound), most);
}

// Of what has no limit only the size is shown, of the largest size there is.
export function stateOf(limit, value) {
  if (limit.lower === null && limit.upper === null) {
    return { use: NaN, size: Math.abs(value) / limit.most, value, state: "ok" };
  }
  const use = used(limit, value);
  return { use, size: use, value, state: use > 1 + EXACT ? "over" : use > NEAR ? "near" : "ok" };
}

function element(name, text, className) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

export function shown(value) {
  if (Number.isNaN(value)) return "\u2013";
  if (Math.abs(value) >= 1e5) return value.toExponential(2);
  const digits = Math.max(0, 2 - Math.floor(Math.log10(Math.max(Math.abs(value), 1e-3))));
  return value.toFixed(Math.min(4, digits)).replace("-", "\u2212");
}

export class Meters {
  constructor(table, sentence, { time, limits, values }) {
    Object.assign(this, { sentence, time, limits, values });
    const owners = [...new Set(limits.map((limit) => limit.owner))];
    const quantities = ORDER.filter((quantity) => limits.some((limit) => limit.quantity === quantity));
    const head = element("tr");
    head.append(element("th", ""), ...quantities.map((name) => element("th", name)));
    head.childNodes.forEach((cell) => cell.setAttribute("scope", "col"));
    table.createTHead().append(head);
    const body = table.createTBody();
    this.cells = new Map();
    owners.forEach((owner) => {
      const row = element("tr");
      const name = element("th", owner);
      name.setAttribute("scope", "row");
      row.append(name, ...quantities.map((quantity) => this.cell(owner, quantity)));
      body.append(row);
    });
  }

  cell(owner, quantity) {
    const cell = element("td");
    const number = this.limits.findIndex((limit) => limit.owner === owner && limit.quantity === quantity);
    if (number < 0) return cell;
    cell.dataset.label = quantity; // beside the bar on a narrow page
    const [text, bar, fill] = [element("span", "", "value"), element("span", "", "bar"), element("span", "", "fill")];
    bar.append(fill);
    cell.append(text, bar);
    this.cells.set(number, { cell, text, fill });
    return cell;
  }

  // Shows every limit at an instant; returns the states of bodies.
  show(t) {
    const now = between(this.time, this.values, t);
    const bodies = new Map();
    let worst = -1;
    const states = this.limits.map((limit, k) => stateOf(limit, now[k]));
    states.forEach(({ use, size, value, state }, k) => {
      const limit = this.limits[k];
      if (!Number.isNaN(use) && (worst < 0 || use > states[worst].use)) worst = k;
      this.fillIn(k, limit, size, value, state);
      if (state === "ok") return;
      limit.bodies.forEach((body) => {
        if (bodies.get(body) !== "over") bodies.set(body, state);
      });
    });
    this.sentence.textContent = worst < 0 ? "No limit is known here." : this.nearest(this.limits[worst], states[worst]);
    this.sentence.dataset.state = worst < 0 ? "ok" : states[worst].state;
    return { bodies };
  }

  fillIn(number, limit, size, value, state) {
    const cell = this.cells.get(number);
    if (cell === undefined) return;
    cell.text.textContent = `${shown(value)} ${limit.unit} ${MARKS[state]}`.trim();
    cell.fill.style.width = `${100 * Math.min(1, Math.max(0, size || 0))}%`;
    cell.cell.dataset.state = state;
  }

  nearest(limit, { use, value, state }) {
    const bound = limit.upper !== null && (limit.lower === null || value > (limit.lower + limit.upper) / 2)
      ? limit.upper : limit.lower;
    const how = state === "over" ? "BROKEN" : `${(100 * use).toFixed(1)} % used`;
    return `Nearest limit: ${limit.owner} ${limit.quantity}, ${shown(value)} of ${shown(bound)} ${limit.unit}, ${how}`;
  }
}

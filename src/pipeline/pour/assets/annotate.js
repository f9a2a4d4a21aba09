"use strict";
// Painting: every point has one of four kinds; strokes are kept, so that each can be undone.

const KINDS = ["none", "container", "rim", "handle"];
// Container, rim and handle of each kind: rim points are container points, too.
const PARTS_OF = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 1]];
const byId = (id) => document.getElementById(id);
const read = (id) => JSON.parse(byId(id).textContent);

class Painting {
  constructor(parts) {
    this.kinds = Uint8Array.from(parts, ([container, rim, handle]) => (rim ? 2 : handle ? 3 : container ? 1 : 0));
    this.done = []; this.undone = []; this.stroke = null; this.saved = true;
  }
  begin() { this.stroke = new Map(); }
  paint(indices, kind) {
    for (const i of indices) {
      if (this.kinds[i] === kind) continue;
      if (!this.stroke.has(i)) this.stroke.set(i, this.kinds[i]);
      this.kinds[i] = kind;
    }
  }
  end() {
    if (this.stroke && this.stroke.size) { this.done.push(this.stroke); this.undone = []; this.saved = false; }
    this.stroke = null;
  }
  /** Forget a stroke that was begun. */
  cancel() {
    for (const [i, kind] of this.stroke || []) this.kinds[i] = kind;
    this.stroke = null;
  }
  /** Take the last stroke of `from` back and keep in `to` how to do it again. */
  swap(from, to) {
    const stroke = from.pop();
    if (!stroke) return;
    const back = new Map();
    for (const [i, kind] of stroke) { back.set(i, this.kinds[i]); this.kinds[i] = kind; }
    to.push(back);
    this.saved = false;
  }
  undo() { this.swap(this.done, this.undone); }
  redo() { this.swap(this.undone, this.done); }
  parts() { return Array.from(this.kinds, (kind) => PARTS_OF[kind]); }
  counts() { return KINDS.map((_, kind) => this.kinds.reduce((sum, value) => sum + (value === kind), 0)); }
}

class Page {
  constructor() {
    const start = read("start");
    this.points = new Float32Array(start.points);
    this.painting = new Painting(start.parts);
    this.viewer = new Viewer(document.querySelector("canvas"));
    this.viewer.parallel = true; // so that a box cuts straight through
    this.viewer.steer({ mayTurn: (event) => this.turns(event), wheel: true });
    this.fingers = new Set();
    this.choose("part", "container");
    this.choose("tool", "brush");
    this.listen();
  }

  async start() {
    this.viewer.show(await this.viewer.load(read("object")));
    this.refresh();
    document.body.dataset.ready = "yes";
  }

  turns(event) { return this.tool === "turn" || event.button === 2 || event.altKey || this.fingers.size > 0; }

  choose(what, name) {
    this[what] = name;
    for (const button of document.querySelectorAll(`[data-${what}]`)) button.setAttribute("aria-pressed", String(button.dataset[what] === name));
    this.viewer.canvas.classList.toggle("turning", this.tool === "turn");
  }

  listen() {
    const canvas = this.viewer.canvas;
    for (const what of ["part", "tool"])
      for (const button of document.querySelectorAll(`[data-${what}]`)) button.addEventListener("click", () => this.choose(what, button.dataset[what]));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => this.up(event));
    byId("undo").addEventListener("click", () => this.again("undo"));
    byId("redo").addEventListener("click", () => this.again("redo"));
    byId("save").addEventListener("click", () => this.save());
    byId("close").addEventListener("click", () => this.close());
    document.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("beforeunload", (event) => { if (!this.painting.saved) event.preventDefault(); });
  }

  key(event) {
    const control = event.ctrlKey || event.metaKey, key = event.key.toLowerCase();
    const part = { 1: "container", 2: "rim", 3: "handle", 0: "none" }[key], tool = { t: "turn", b: "brush", x: "box" }[key];
    if (control && key === "z") this.again(event.shiftKey ? "redo" : "undo");
    else if (control && key === "y") this.again("redo");
    else if (control && key === "s") this.save();
    else if (control || event.altKey) return;
    else if (part) this.choose("part", part);
    else if (tool) this.choose("tool", tool);
    else if (key === "[" || key === "]") byId("size").value = Number(byId("size").value) + (key === "[" ? -4 : 4);
    else return;
    event.preventDefault();
  }

  place(event) {
    const box = this.viewer.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    if (this.turns(event)) {
      this.again("cancel"); // a second finger: the first one did not mean to paint
      return;
    }
    if (event.button !== 0) return;
    if (event.pointerType === "touch") this.fingers.add(event.pointerId);
    this.viewer.canvas.setPointerCapture(event.pointerId);
    this.seen = this.viewer.project(this.points);
    this.from = this.last = this.place(event);
    this.painting.begin();
    if (this.tool === "brush") this.brush(this.from, this.from);
  }

  move(event) {
    const at = this.place(event);
    this.showMark(at);
    if (!this.painting.stroke || this.tool === "turn") return;
    if (this.tool === "brush") this.brush(this.last, at);
    this.last = at;
  }

  up(event) {
    this.fingers.delete(event.pointerId);
    if (!this.painting.stroke) return;
    if (this.tool === "box") this.box(this.from, this.place(event));
    this.painting.end();
    byId("mark").style.display = "none";
    this.refresh();
  }

  /** Paint what is seen within the brush along the way from `a` to `b`. */
  brush(a, b) {
    const { x, y, visible } = this.seen, radius = Number(byId("size").value), found = [];
    const dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy || 1;
    for (let i = 0; i < x.length; i++) {
      if (!visible[i]) continue;
      const t = Math.max(0, Math.min(1, ((x[i] - a[0]) * dx + (y[i] - a[1]) * dy) / square));
      if (Math.hypot(x[i] - a[0] - t * dx, y[i] - a[1] - t * dy) <= radius) found.push(i);
    }
    this.apply(found);
  }

  box(a, b) {
    const { x, y, visible } = this.seen, through = byId("through").checked, found = [];
    const [left, right] = [Math.min(a[0], b[0]), Math.max(a[0], b[0])], [top, bottom] = [Math.min(a[1], b[1]), Math.max(a[1], b[1])];
    for (let i = 0; i < x.length; i++)
      if ((through || visible[i]) && x[i] >= left && x[i] <= right && y[i] >= top && y[i] <= bottom) found.push(i);
    this.apply(found);
  }

  apply(indices) {
    this.painting.paint(indices, KINDS.indexOf(this.part));
    this.colour();
  }

  again(what) { this.painting[what](); this.refresh(); }

  colour() {
    const { nearest } = this.viewer.loaded, parts = this.viewer.loaded.parts, { kinds } = this.painting;
    for (let v = 0; v < nearest.length; v++) {
      const of = PARTS_OF[kinds[nearest[v]]];
      for (let k = 0; k < 3; k++) parts[3 * v + k] = 255 * of[k];
    }
    this.viewer.setParts(parts);
  }

  refresh() {
    this.colour();
    this.painting.counts().forEach((count, kind) => { byId(`n-${KINDS[kind]}`).value = count; });
    byId("undo").disabled = !this.painting.done.length;
    byId("redo").disabled = !this.painting.undone.length;
  }

  showMark(at) {
    const mark = byId("mark"), size = Number(byId("size").value), painting = this.tool === "box" && this.painting.stroke;
    mark.className = this.tool;
    const [x, y, w, h] = painting
      ? [Math.min(at[0], this.from[0]), Math.min(at[1], this.from[1]), Math.abs(at[0] - this.from[0]), Math.abs(at[1] - this.from[1])]
      : [at[0] - size, at[1] - size, 2 * size, 2 * size];
    Object.assign(mark.style, { left: `${x}px`, top: `${y}px`, width: `${w}px`, height: `${h}px`, display: painting || this.tool === "brush" ? "block" : "none" });
  }

  say(words, bad = false) {
    byId("said").textContent = words;
    byId("said").classList.toggle("bad", bad);
  }

  async post(path, content) {
    try {
      const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json", "X-Token": TOKEN }, body: JSON.stringify(content) });
      return await answer.json();
    } catch { return { error: "The program in the terminal has ended; call pour annotate again before you close this page" }; }
  }

  async save() {
    const stroke = this.painting.done.at(-1), { error, answer } = await this.post("/save", this.painting.parts());
    if (error) return this.say(error, true);
    this.painting.saved = this.painting.done.at(-1) === stroke;
    return this.say(`saved: ${answer.container} container, ${answer.rim} rim, ${answer.handle} handle`);
  }

  async close() {
    if (!this.painting.saved && !confirm("Close without saving?")) return;
    this.painting.saved = true;
    const { error } = await this.post("/close", null);
    this.say(error || "closed; this page can go", Boolean(error));
  }
}

let page;
try {
  page = new Page();
  page.start();
} catch (error) { byId("said").textContent = error.message; byId("said").classList.add("bad"); }

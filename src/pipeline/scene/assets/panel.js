"use strict";
// The viewer with its controls: which object, how full, how far tilted.

class Panel {
  constructor(element, objects) {
    this.element = element; this.objects = objects; this.loaded = {};
    this.inputs = Object.fromEntries([...element.querySelectorAll("input")].map((input) => [input.name, input]));
    this.viewer = new Viewer(element.querySelector("canvas"));
    this.viewer.steer({});
    element.addEventListener("input", () => { this.stop(); this.update(); });
    element.querySelector("[name=pour]").addEventListener("click", () => this.pour());
    element.querySelector("[name=reset]").addEventListener("click", () => this.reset());
  }

  async show(name) {
    const object = this.objects.find((one) => one.name === name);
    this.loaded[name] = this.loaded[name] || (await this.viewer.load(object));
    this.stop();
    this.object = object;
    this.viewer.show(this.loaded[name]);
    this.element.querySelector(".title").textContent = object.title;
    for (const name of ["fill", "tilt"]) this.inputs[name].disabled = !object.room;
    this.element.querySelector("[name=pour]").disabled = !object.room;
    this.element.dataset.shown = name;
    this.update();
  }

  update() {
    const { viewer, inputs, object } = this, liquid = viewer.loaded.liquid;
    const share = inputs.fill.value / 100, degrees = Number(inputs.tilt.value);
    for (const name of ["glass", "coloured", "marked"]) viewer[name] = inputs[name].checked;
    this.element.querySelector("output[name=fill]").textContent = `${inputs.fill.value} %`;
    this.element.querySelector("output[name=tilt]").textContent = `${inputs.tilt.value}°`;
    if (liquid) {
      liquid.set(share, (degrees * Math.PI) / 180);
      viewer.model = liquid.model();
    }
    this.element.querySelector(".readout").textContent = liquid ? this.words(liquid, object) : "It holds no liquid.";
    viewer.draw();
  }

  words(liquid, object) {
    const ml = (object.room.capacity_m3 * 1e6) / liquid.capacity, filled = liquid.share * liquid.capacity;
    if (!filled) return `Empty. Up to its rim it holds ${(liquid.capacity * ml).toFixed(0)} ml.`;
    const spilt = filled - liquid.kept, told = `${(filled * ml).toFixed(0)} ml in a capacity of ${(liquid.capacity * ml).toFixed(0)} ml.`;
    if (spilt < 2e-3 * liquid.capacity) return `${told} Nothing is above the lip: it keeps all.`;
    return `${told} Tilted slowly by ${this.inputs.tilt.value}° it pours ${(spilt * ml).toFixed(0)} ml and keeps ${(liquid.kept * ml).toFixed(0)} ml.`;
  }

  /** Tilt to 110° in a few seconds. */
  pour() {
    this.stop();
    const begun = performance.now(), last = 110;
    const step = (now) => {
      const t = Math.min(1, (now - begun) / 4000), smooth = t * t * (3 - 2 * t);
      this.inputs.tilt.value = Math.round(last * smooth);
      this.update();
      this.frame = t < 1 ? requestAnimationFrame(step) : 0;
    };
    this.frame = requestAnimationFrame(step);
  }

  stop() { if (this.frame) cancelAnimationFrame(this.frame); this.frame = 0; }

  reset() {
    this.stop();
    this.inputs.tilt.value = 0;
    this.inputs.fill.value = 60;
    Object.assign(this.viewer, { azimuth: 0.7, elevation: 0.55, zoom: 1 });
    this.update();
  }
}

/** Put a small picture of every object on the canvas of its name, one after another. */
async function drawThumbnails(objects, canvasOf) {
  const hidden = document.createElement("canvas");
  hidden.width = 240; hidden.height = 200;
  const viewer = new Viewer(hidden);
  viewer.fit = () => {};
  viewer.marked = false;
  viewer.zoom = 0.8;
  for (const object of objects) {
    const canvas = canvasOf(object.name);
    if (!canvas) continue;
    viewer.loaded = await viewer.load({ ...object, room: null, rim_m: null, lip_m: null });
    viewer.drawNow();
    canvas.width = hidden.width; canvas.height = hidden.height;
    canvas.getContext("2d").drawImage(hidden, 0, 0);
    viewer.gl.deleteVertexArray(viewer.loaded.mesh.vao);
    await new Promise((done) => setTimeout(done));
  }
}

function sorry(element, error) {
  const note = document.createElement("div");
  note.className = "sorry";
  note.textContent = `The object cannot be drawn: ${error.message}.`;
  element.querySelector(".stage").append(note);
}

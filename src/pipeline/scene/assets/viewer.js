"use strict";
// A small WebGL 2 viewer of one object: shaded surface in the colours of its parts, marks, liquid. Metres, z up.

const PARTS_RGB = { container: [0.337, 0.706, 0.914], rim: [0.835, 0.369, 0], handle: [0, 0.62, 0.451], none: [0.62, 0.62, 0.62] };
const MARK_RGB = [0.9, 0.62, 0];

const SURFACE_VERTEX = `#version 300 es
uniform mat4 u_view, u_model, u_projection;
in vec3 a_position, a_normal;
in vec3 a_parts;
out vec3 v_normal, v_parts, v_position, v_eye;
void main() {
  vec4 eye = u_view * u_model * vec4(a_position, 1.0);
  v_normal = mat3(u_view) * mat3(u_model) * a_normal;
  v_parts = a_parts; v_position = a_position; v_eye = eye.xyz;
  gl_Position = u_projection * eye;
}`;

const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 u_container, u_rim, u_handle, u_none, u_flat;
uniform float u_alpha, u_parts;
in vec3 v_normal, v_parts, v_eye;
out vec4 colour;
float edge(float value) {
  float width = max(fwidth(value), 1e-4);
  return clamp((value - 0.5) / width + 0.5, 0.0, 1.0);
}
void main() {
  vec3 base = mix(u_none, u_container, edge(v_parts.x));
  base = mix(base, u_handle, edge(v_parts.z));
  base = mix(base, u_rim, edge(v_parts.y));
  base = mix(u_flat, base, u_parts);
  vec3 to_eye = normalize(-v_eye);
  vec3 normal = normalize(v_normal);
  float facing = dot(normal, to_eye);
  if (facing < 0.0) { normal = -normal; facing = -facing; }
  float key = max(dot(normal, normalize(vec3(-0.45, 0.75, 0.6))), 0.0);
  float fill = 0.5 + 0.5 * normal.y;
  float shine = pow(max(dot(reflect(-to_eye, normal), normalize(vec3(-0.45, 0.75, 0.6))), 0.0), 40.0);
  vec3 lit = base * (0.54 + 0.2 * fill + 0.34 * key + 0.08 * facing) + 0.16 * shine;
  float alpha = mix(u_alpha, min(1.0, u_alpha * 2.6), (1.0 - facing) * (1.0 - facing));
  alpha = max(alpha, u_parts * edge(v_parts.y) * min(1.0, 2.0 * u_alpha));
  colour = vec4(lit * alpha, alpha);
}`;

const DEPTH_FRAGMENT = `#version 300 es
precision highp float;
uniform float u_far;
in vec3 v_eye;
out vec4 colour;
void main() {
  vec3 digits = fract(clamp(-v_eye.z / u_far, 0.0, 0.999999) * vec3(1.0, 255.0, 65025.0));
  colour = vec4(digits - digits.yzz * vec3(1.0 / 255.0, 1.0 / 255.0, 0.0), 1.0);
}`;

/** Undo pipeline.scene.packing.pack: {name: typed array}. */
async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const types = { float32: Float32Array, uint32: Uint32Array, uint16: Uint16Array, uint8: Uint8Array, int8: Int8Array };
  const arrays = {};
  for (const [name, { type, count, offset }] of Object.entries(packed.arrays))
    arrays[name] = new types[type](buffer, offset, count);
  return arrays;
}

const Vec = {
  sub: (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
  add: (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]],
  mul: (a, s) => [a[0] * s, a[1] * s, a[2] * s],
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  unit(a) { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; },
};

// 4×4 matrices, column by column as WebGL takes them.
const Mat = {
  identity: () => new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
  perspective(fov, aspect, near, far) {
    const f = 1 / Math.tan(fov / 2), d = 1 / (near - far);
    return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * d, -1, 0, 0, 2 * far * near * d, 0]);
  },
  parallel(height, aspect, near, far) {
    const d = 1 / (near - far);
    return new Float32Array([1 / (height * aspect), 0, 0, 0, 0, 1 / height, 0, 0, 0, 0, 2 * d, 0, 0, 0, (far + near) * d, 1]);
  },
  lookAt(eye, target, up) {
    const z = Vec.unit(Vec.sub(eye, target)), x = Vec.unit(Vec.cross(up, z)), y = Vec.cross(z, x);
    return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0,
      -Vec.dot(x, eye), -Vec.dot(y, eye), -Vec.dot(z, eye), 1]);
  },
  /** Rotation by `angle` about a unit axis through `point`. */
  about(axis, point, angle) {
    const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), t = 1 - c;
    const m = new Float32Array([t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0,
      t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0, t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0, 0, 0, 0, 1]);
    const turned = Mat.apply(m, point);
    for (let i = 0; i < 3; i++) m[12 + i] = point[i] - turned[i];
    return m;
  },
  apply: (m, p) => [0, 1, 2].map((i) => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]),
  multiply(a, b) {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++)
      for (let r = 0; r < 4; r++)
        for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    return out;
  },
};

/** Triangles of a tube along points (closed or not): {positions, normals, triangles}. */
function tube(points, radius, closed) {
  const sides = 8, positions = [], normals = [], triangles = [], n = points.length;
  for (let i = 0; i < n; i++) {
    const before = points[closed ? (i + n - 1) % n : Math.max(i - 1, 0)], after = points[closed ? (i + 1) % n : Math.min(i + 1, n - 1)];
    const along = Vec.unit(Vec.sub(after, before));
    const side = Vec.unit(Vec.cross(along, Math.abs(along[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1])), other = Vec.cross(side, along);
    for (let s = 0; s < sides; s++) {
      const a = (2 * Math.PI * s) / sides, normal = Vec.add(Vec.mul(side, Math.cos(a)), Vec.mul(other, Math.sin(a)));
      positions.push(...Vec.add(points[i], Vec.mul(normal, radius)));
      normals.push(...normal);
    }
  }
  for (let i = 0; i < (closed ? n : n - 1); i++)
    for (let s = 0; s < sides; s++) {
      const a = i * sides + s, b = i * sides + ((s + 1) % sides), c = ((i + 1) % n) * sides + s, d = ((i + 1) % n) * sides + ((s + 1) % sides);
      triangles.push(a, b, c, b, d, c);
    }
  return { positions, normals, triangles };
}

function sphere(centre, radius) {
  const rings = 10, sides = 16, positions = [], normals = [], triangles = [];
  for (let i = 0; i <= rings; i++)
    for (let j = 0; j <= sides; j++) {
      const a = (Math.PI * i) / rings, b = (2 * Math.PI * j) / sides;
      const normal = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
      positions.push(...Vec.add(centre, Vec.mul(normal, radius)));
      normals.push(...normal);
    }
  for (let i = 0; i < rings; i++)
    for (let j = 0; j < sides; j++) {
      const a = i * (sides + 1) + j, b = a + sides + 1;
      triangles.push(a, b, a + 1, b, b + 1, a + 1);
    }
  return { positions, normals, triangles };
}

class Viewer {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = (this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true }));
    if (!gl) throw new Error("WebGL 2 is not available in this browser");
    this.surface = this.program(SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.azimuth = 0.7; this.elevation = 0.55; this.zoom = 1;
    this.model = Mat.identity();
    this.parallel = false; this.glass = false; this.coloured = true; this.marked = true;
    this.things = []; this.liquid = null;
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    ["a_position", "a_normal", "a_parts"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  uniforms(program, values) {
    const gl = this.gl;
    for (const [name, value] of Object.entries(values)) {
      const where = gl.getUniformLocation(program, name);
      if (value.length === 16) gl.uniformMatrix4fv(where, false, value);
      else if (value.length) gl[`uniform${value.length}fv`](where, value);
      else gl.uniform1f(where, value);
    }
  }

  /** Return what `drawThing` takes. positions, normals: flat arrays; parts: flat (V × 3 bytes) or nothing. */
  thing({ positions, normals, parts, triangles }) {
    const gl = this.gl, vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    const attribute = (index, data, type, normalised) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, 3, type, normalised, 0, 0);
      return buffer;
    };
    attribute(0, new Float32Array(positions), gl.FLOAT, false);
    attribute(1, new Float32Array(normals), gl.FLOAT, false);
    const partsBuffer = parts ? attribute(2, parts, gl.UNSIGNED_BYTE, true) : null;
    const elements = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, elements);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(triangles), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { vao, count: triangles.length, partsBuffer };
  }

  /** Take an object made by pipeline.scene: its surface, and where there are any its marks and its room for liquid. */
  async load(object) {
    const a = await unpack(object.surface), low = object.low_m, span = object.span_m;
    const positions = new Float32Array(a.positions.length);
    for (let i = 0; i < positions.length; i++) positions[i] = low[i % 3] + (a.positions[i] / 65535) * span[i % 3];
    const normals = Float32Array.from(a.normals, (value) => value / 127);
    const parts = new Uint8Array(a.parts);
    const loaded = { object, positions, triangles: a.triangles, parts, nearest: a.nearest, low, span };
    loaded.mesh = this.thing({ positions, normals, parts, triangles: a.triangles });
    loaded.marks = this.marksOf(object);
    if (object.room && typeof Liquid !== "undefined") loaded.liquid = new Liquid(this, object, await unpack(object.room.radii));
    return loaded;
  }

  marksOf(object) {
    const size = Math.hypot(...object.span_m), marks = [];
    if (object.rim_m) marks.push(tube(object.rim_m, 0.0055 * size, true));
    if (object.lip_m) {
      marks.push(sphere(object.lip_m, 0.021 * size));
      const out = Vec.unit([object.lip_m[0] - object.opening_m[0], object.lip_m[1] - object.opening_m[1], 0]);
      marks.push(tube([object.opening_m, object.lip_m], 0.003 * size, false));
      marks.push(sphere(object.opening_m, 0.011 * size));
      const axis = Vec.mul(Vec.cross([0, 0, 1], out), 0.14 * size);
      marks.push(tube([Vec.sub(object.lip_m, axis), Vec.add(object.lip_m, axis)], 0.0035 * size, false));
    }
    return marks.map((mark) => this.thing(mark));
  }

  show(loaded) {
    this.loaded = loaded;
    this.model = Mat.identity();
    this.draw();
  }

  setParts(parts) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.loaded.mesh.partsBuffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, parts);
    this.draw();
  }

  camera() {
    const { low, span } = this.loaded, target = Mat.apply(this.model, Vec.add(low, Vec.mul(span, 0.5)));
    const radius = Math.hypot(...span) / 2, aspect = this.canvas.width / Math.max(1, this.canvas.height), fov = 0.5;
    const distance = ((1.12 * radius) / Math.sin(fov / 2) / Math.min(1, aspect)) * this.zoom;
    const c = Math.cos(this.elevation);
    const away = [c * Math.cos(this.azimuth), c * Math.sin(this.azimuth), Math.sin(this.elevation)];
    const eye = Vec.add(target, Vec.mul(away, distance));
    const view = Mat.lookAt(eye, target, [0, 0, 1]);
    const near = Math.max(distance - 3 * radius, distance / 50), far = distance + 3 * radius;
    const projection = this.parallel ? Mat.parallel(distance * Math.tan(fov / 2), aspect, near, far) : Mat.perspective(fov, aspect, near, far);
    return { eye, view, projection, far };
  }

  fit() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(this.canvas.clientWidth * ratio), height = Math.round(this.canvas.clientHeight * ratio);
    if (width && height && (this.canvas.width !== width || this.canvas.height !== height)) {
      this.canvas.width = width; this.canvas.height = height;
    }
  }

  /** Draw at the next frame, once however often it is asked for. */
  draw() {
    if (this.waiting || !this.loaded) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.fit(); this.drawNow(); });
  }

  drawNow() {
    const gl = this.gl, { view, projection } = this.camera(), loaded = this.loaded;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const shared = { u_view: view, u_projection: projection, u_model: this.model };
    gl.useProgram(this.surface);
    this.uniforms(this.surface, { ...shared, u_container: PARTS_RGB.container, u_rim: PARTS_RGB.rim, u_handle: PARTS_RGB.handle, u_none: PARTS_RGB.none });
    if (this.marked) {
      this.uniforms(this.surface, { u_parts: 0, u_flat: MARK_RGB, u_alpha: 1 });
      loaded.marks.forEach((mark) => this.drawThing(mark));
    }
    this.uniforms(this.surface, { u_parts: this.coloured ? 1 : 0, u_flat: [0.78, 0.79, 0.8], u_alpha: this.glass ? 0.2 : 1 });
    if (!this.glass) this.drawThing(loaded.mesh);
    if (loaded.liquid) loaded.liquid.draw(shared);
    if (this.glass) this.drawGlass(loaded.mesh);
  }

  /** Far faces, then near ones: a wall that one can look through. */
  drawGlass(mesh) {
    const gl = this.gl;
    gl.useProgram(this.surface);
    gl.depthMask(false);
    gl.enable(gl.CULL_FACE);
    for (const side of [gl.FRONT, gl.BACK]) { gl.cullFace(side); this.drawThing(mesh); }
    gl.disable(gl.CULL_FACE);
    gl.depthMask(true);
  }

  drawThing({ vao, count }) {
    this.gl.bindVertexArray(vao);
    this.gl.drawElements(this.gl.TRIANGLES, count, this.gl.UNSIGNED_INT, 0);
  }

  /** Where points (flat, object frame) are on the canvas, in CSS pixels, and which of them nothing hides. */
  project(points, tolerance = 0.0015) {
    this.fit();
    const { view, projection, far } = this.camera(), both = Mat.multiply(projection, view);
    const depth = this.depths(view, projection, far), { width, height, clientWidth, clientHeight } = this.canvas;
    const n = points.length / 3, x = new Float32Array(n), y = new Float32Array(n), visible = new Uint8Array(n);
    for (let i = 0; i < n; i++) {
      const p = [points[3 * i], points[3 * i + 1], points[3 * i + 2]], w = both[3] * p[0] + both[7] * p[1] + both[11] * p[2] + both[15];
      const [u, v] = Mat.apply(both, p).map((value) => 0.5 + (0.5 * value) / w);
      x[i] = u * clientWidth; y[i] = (1 - v) * clientHeight;
      const column = Math.floor(u * width), row = Math.floor(v * height);
      if (column < 0 || row < 0 || column >= width || row >= height) continue;
      visible[i] = -Mat.apply(view, p)[2] <= depth(column, row) + tolerance;
    }
    return { x, y, visible };
  }

  depths(view, projection, far) {
    const gl = this.gl, { width, height } = this.canvas;
    this.depth = this.depth || this.program(SURFACE_VERTEX, DEPTH_FRAGMENT);
    const frame = gl.createFramebuffer(), colour = gl.createRenderbuffer(), behind = gl.createRenderbuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    for (const [buffer, format, where] of [[colour, gl.RGBA8, gl.COLOR_ATTACHMENT0], [behind, gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, where, gl.RENDERBUFFER, buffer);
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.depth);
    this.uniforms(this.depth, { u_view: view, u_projection: projection, u_model: Mat.identity(), u_far: far });
    this.drawThing(this.loaded.mesh);
    const bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(frame); gl.deleteRenderbuffer(colour); gl.deleteRenderbuffer(behind);
    return (column, row) => {
      const k = 4 * (row * width + column);
      return (far * (bytes[k] + bytes[k + 1] / 255 + bytes[k + 2] / 65025)) / 255;
    };
  }

  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = Math.max(-1.45, Math.min(1.5, this.elevation + dy));
    this.draw();
  }

  scale(factor) {
    this.zoom = Math.max(0.25, Math.min(2.5, this.zoom * factor));
    this.draw();
  }

  /** Turn by dragging, arrows and two fingers. `mayTurn(event)`: whether a press turns; wheel: zoom without Ctrl, too. */
  steer({ mayTurn = () => true, wheel = false } = {}) {
    const fingers = new Map(), canvas = this.canvas;
    const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    canvas.addEventListener("pointerdown", (event) => {
      if (!mayTurn(event)) return;
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const before = fingers.size === 2 ? apart() : 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 2) this.scale(before / Math.max(apart(), 1));
      else this.turn((event.clientX - last[0]) * 0.009, (event.clientY - last[1]) * 0.009);
    });
    for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => {
      if (!wheel && !event.ctrlKey) return;
      event.preventDefault();
      this.scale(Math.exp(event.deltaY * 0.0012));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
      if (turns) this.turn(...turns);
      else if (event.key === "+" || event.key === "=") this.scale(0.88);
      else if (event.key === "-") this.scale(1.14);
      else return;
      event.preventDefault();
    });
  }
}

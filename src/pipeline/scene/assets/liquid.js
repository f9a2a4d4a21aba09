"use strict";
// What hydrostatics says of the liquid in a tilted container: it stays below its lip. Drawn and computed from one table of
// the room's radius by height and azimuth.

const LIQUID_RGB = [0, 0.447, 0.698];

const LIQUID_VERTEX = `#version 300 es
uniform mat4 u_view, u_model, u_projection;
in vec3 a_position, a_normal;
out vec3 v_position, v_normal, v_eye;
void main() {
  vec4 eye = u_view * u_model * vec4(a_position, 1.0);
  v_position = a_position; v_eye = eye.xyz;
  v_normal = mat3(u_view) * mat3(u_model) * a_normal;
  gl_Position = u_projection * eye;
}`;

const LIQUID_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D u_radii;
uniform vec3 u_axis, u_up, u_colour;
uniform float u_level, u_bottom, u_top, u_reach, u_cap, u_alpha;
in vec3 v_position, v_normal, v_eye;
out vec4 colour;
void main() {
  vec2 away = v_position.xy - u_axis.xy;
  float height = (v_position.z - u_bottom) / (u_top - u_bottom);
  if (u_cap > 0.5) {
    float turn = atan(away.y, away.x) / 6.28318530718 + 0.5;
    if (height < 0.0 || height > 1.0 || length(away) > u_reach * texture(u_radii, vec2(turn, height)).r) discard;
  } else if (dot(u_up, v_position) > u_level) discard;
  vec3 normal = normalize(v_normal), to_eye = normalize(-v_eye);
  float light = 0.62 + 0.38 * abs(dot(normal, normalize(vec3(-0.45, 0.75, 0.6))));
  float gloss = u_cap * pow(1.0 - abs(dot(normal, to_eye)), 3.0);
  vec3 lit = mix(u_colour * light, vec3(1.0), (0.22 + 0.5 * gloss) * u_cap);
  colour = vec4(lit * u_alpha, u_alpha);
}`;

class Liquid {
  constructor(viewer, object, { radii }) {
    this.viewer = viewer; this.object = object; this.radii = radii;
    this.room = object.room;
    this.share = 0; this.tilt = 0;
    this.points = this.quadrature();
    const rim = object.rim_m.map((p) => p[2]);
    this.capacity = this.below([0, 0, 1], Math.min(...rim));
    this.update();
  }

  /** Points that fill the room, each with its volume: the middle of equal shares of every sector of every layer. */
  quadrature() {
    const { layers, sectors, reach_m, bottom_m, top_m, axis_m } = this.room, shells = 5, points = [];
    const thick = (top_m - bottom_m) / layers, turn = (2 * Math.PI) / sectors;
    for (let k = 0; k < layers; k++)
      for (let j = 0; j < sectors; j++) {
        const radius = (reach_m * this.radii[k * sectors + j]) / 255, volume = (0.5 * radius * radius * turn * thick) / shells;
        for (let s = 0; s < shells && volume > 0; s++) {
          const r = radius * Math.sqrt((s + 0.5) / shells), a = (j + 0.5) * turn - Math.PI;
          points.push([axis_m[0] + r * Math.cos(a), axis_m[1] + r * Math.sin(a), bottom_m + (k + 0.5) * thick, volume]);
        }
      }
    return points;
  }

  below(up, level) {
    const thick = (this.room.top_m - this.room.bottom_m) / this.room.layers;
    return this.points.reduce((sum, p) => sum + p[3] * Math.max(0, Math.min(1, 0.5 + (level - Vec.dot(up, p)) / thick)), 0);
  }

  /** Unit axis about which the cup tilts, through its lip. */
  axis() {
    const { lip_m, opening_m } = this.object;
    const out = Vec.unit([lip_m[0] - opening_m[0], lip_m[1] - opening_m[1], 0]);
    return [-out[1], out[0], 0];
  }

  /** What is kept when brimful liquid is tilted to `tilt`: nothing that was lost comes back. */
  room_at(tilt) {
    let least = Infinity;
    for (let step = 0; step <= 12; step++) {
      const up = this.up((tilt * step) / 12);
      least = Math.min(least, this.below(up, Math.min(...this.object.rim_m.map((p) => Vec.dot(up, p)))));
    }
    return least;
  }

  up(tilt) {
    const m = Mat.about(this.axis(), [0, 0, 0], -tilt);
    return [m[8], m[9], m[10]];
  }

  /** Set what share of the capacity was filled in, and the tilt in radians. */
  set(share, tilt) {
    this.share = share; this.tilt = tilt;
    this.update();
  }

  update() {
    const filled = this.share * this.capacity;
    this.kept = Math.min(filled, this.tilt ? this.room_at(this.tilt) : this.capacity);
    this.normal = this.up(this.tilt);
    let low = Infinity, high = -Infinity;
    for (const p of this.points) { const h = Vec.dot(this.normal, p); low = Math.min(low, h); high = Math.max(high, h); }
    low -= 0.01; high += 0.01;
    for (let i = 0; i < 24; i++) {
      const middle = (low + high) / 2;
      if (this.below(this.normal, middle) < this.kept) low = middle; else high = middle;
    }
    this.level = low;
  }

  model() { return this.tilt ? Mat.about(this.axis(), this.object.lip_m, this.tilt) : Mat.identity(); }

  prepare() {
    const viewer = this.viewer, gl = viewer.gl, { layers, sectors, reach_m, bottom_m, top_m, axis_m } = this.room;
    viewer.liquidProgram = viewer.liquidProgram || viewer.program(LIQUID_VERTEX, LIQUID_FRAGMENT);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, sectors, layers, 0, gl.RED, gl.UNSIGNED_BYTE, this.radii);
    for (const [key, value] of [["MIN_FILTER", "LINEAR"], ["MAG_FILTER", "LINEAR"], ["WRAP_S", "REPEAT"], ["WRAP_T", "CLAMP_TO_EDGE"]])
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${key}`], gl[value]);
    const positions = [], normals = [], triangles = [], inset = 0.985;
    for (let k = 0; k < layers; k++)
      for (let j = 0; j < sectors; j++) {
        const r = (inset * reach_m * this.radii[k * sectors + j]) / 255, a = ((j + 0.5) * 2 * Math.PI) / sectors - Math.PI;
        positions.push(axis_m[0] + r * Math.cos(a), axis_m[1] + r * Math.sin(a), bottom_m + ((k + 0.5) * (top_m - bottom_m)) / layers);
        normals.push(Math.cos(a), Math.sin(a), 0);
      }
    const floor = positions.length / 3;
    positions.push(...axis_m.slice(0, 2), bottom_m + (0.5 * (top_m - bottom_m)) / layers);
    normals.push(0, 0, -1);
    for (let j = 0; j < sectors; j++) {
      const next = (j + 1) % sectors;
      triangles.push(floor, next, j);
      for (let k = 0; k < layers - 1; k++) {
        const a = k * sectors + j, b = k * sectors + next;
        triangles.push(a, b, a + sectors, b, b + sectors, a + sectors);
      }
    }
    this.body = viewer.thing({ positions, normals, triangles });
  }

  /** The surface of the liquid: a square in its plane, of which the shader keeps what is inside. */
  cap() {
    const n = this.normal, { axis_m, bottom_m, top_m, reach_m } = this.room;
    const middle = [axis_m[0], axis_m[1], (bottom_m + top_m) / 2];
    const centre = Vec.add(middle, Vec.mul(n, this.level - Vec.dot(n, middle)));
    const a = Vec.unit(Vec.cross(n, Math.abs(n[0]) > 0.9 ? [0, 1, 0] : [1, 0, 0])), b = Vec.cross(n, a), size = 4 * (reach_m + top_m - bottom_m);
    const corner = (s, t) => Vec.add(centre, Vec.add(Vec.mul(a, s * size), Vec.mul(b, t * size)));
    return { positions: [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)].flat(), normals: [n, n, n, n].flat(), triangles: [0, 1, 2, 0, 2, 3] };
  }

  draw(shared) {
    if (this.share <= 0 || this.kept <= 1e-3 * this.capacity) return;
    if (!this.texture) this.prepare();
    const viewer = this.viewer, gl = viewer.gl, program = viewer.liquidProgram, { reach_m, bottom_m, top_m, axis_m } = this.room;
    gl.useProgram(program);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    viewer.uniforms(program, { ...shared, u_axis: [...axis_m.slice(0, 2), 0], u_up: this.normal, u_level: this.level, u_bottom: bottom_m,
      u_top: top_m, u_reach: reach_m, u_colour: LIQUID_RGB, u_alpha: 0.86, u_cap: 0 });
    viewer.drawThing(this.body);
    const key = [...this.normal, this.level].join();
    if (this.capKey !== key) { this.capKey = key; if (this.capThing) gl.deleteVertexArray(this.capThing.vao); this.capThing = viewer.thing(this.cap()); }
    viewer.uniforms(program, { u_cap: 1 });
    viewer.drawThing(this.capThing);
  }
}

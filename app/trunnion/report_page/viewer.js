// Draws what the software machine did: the beads growing with time, the machine moving, the findings at their place.
// Frames, units and names are those of the JSON in #data: mm, s, rad inside; degrees only in what is shown.

const facts = JSON.parse(document.getElementById("data").textContent);
const byId = (name) => document.getElementById(name);

async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  return packed.type === "int16" ? new Int16Array(buffer) : packed.type === "uint8" ? new Uint8Array(buffer) : new Float32Array(buffer);
}

const rows = {};
for (const [name, packed] of Object.entries(facts.rows)) rows[name] = await unpack(packed);
const deviation = facts.deviation && { points: await unpack(facts.deviation.points), value: await unpack(facts.deviation.value) };
const count = rows.time.length, joints = facts.joints, k = joints.length;
const duration = count ? rows.time[count - 1] : 0;

// ---- small linear algebra: 4x4 matrices, column-major, as WebGL wants them
const identity = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
function multiply(a, b) {
  const out = new Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++)
    out[c * 4 + r] = a[r] * b[c * 4] + a[4 + r] * b[c * 4 + 1] + a[8 + r] * b[c * 4 + 2] + a[12 + r] * b[c * 4 + 3];
  return out;
}
const translation = (v) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, v[0], v[1], v[2], 1];
function rotation(axis, angle) {
  const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), t = 1 - c;
  return [t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0, t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0,
    t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0, 0, 0, 0, 1];
}
const apply = (m, v, w) => [0, 1, 2].map((r) => m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2] + m[12 + r] * w);
function rigidInverse(m) {
  const out = [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, 0, 0, 0, 1];
  const t = apply(out, [m[12], m[13], m[14]], 0);
  out[12] = -t[0]; out[13] = -t[1]; out[14] = -t[2];
  return out;
}

// ---- the joint chain: product of exponentials, from the frame outwards on each side
function side(name, q, most = Infinity) {
  let m = identity(), done = 0;
  joints.forEach((joint, i) => {
    if (joint.side !== name || done++ >= most) return;
    const move = joint.rotary
      ? multiply(multiply(translation(joint.point), rotation(joint.axis, q[i])), translation(joint.point.map((x) => -x)))
      : translation(joint.axis.map((x) => x * q[i]));
    m = multiply(m, move);
  });
  return m;
}
const toolAtZero = (() => {
  const z = facts.tool.axis, guess = Math.abs(z[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (v) => v.map((x) => x / Math.hypot(...v));
  const dot = z[0] * guess[0] + z[1] * guess[1] + z[2] * guess[2];
  const x = unit(guess.map((g, i) => g - dot * z[i])), y = cross(z, x);
  return [...x, 0, ...y, 0, ...z, 0, ...facts.tool.tip, 1];
})();
function pose(q) {
  const machineFromPart = multiply(side("work", q), translation(facts.origin));
  const machineFromTool = multiply(side("tool", q), toolAtZero);
  return { machineFromPart, machineFromTool };
}

// ---- time
function rowAt(time) {
  let low = 0, high = count - 1;
  while (low < high) { const mid = (low + high) >> 1; if (rows.time[mid] < time) low = mid + 1; else high = mid; }
  return low;
}
function stateAt(time) {
  const row = rowAt(time), before = Math.max(row - 1, 0), span = rows.time[row] - rows.time[before];
  const share = span > 0 ? Math.min(Math.max((time - rows.time[before]) / span, 0), 1) : 1;
  const q = Array.from({ length: k }, (_, j) => rows.joints[before * k + j] * (1 - share) + rows.joints[row * k + j] * share);
  return { row, q };
}

// ---- colours
const roleColours = facts.roles.map((role) => role.colour.match(/\w\w/g).map((h) => parseInt(h, 16) / 255));
function ramp(x) { // dark blue over green to yellow, readable for every eye
  const t = Math.min(Math.max(x, 0), 1);
  return [0.27 + t * (t * 1.4 - 0.65), 0.01 + t * 0.9, 0.33 + t * (0.95 - t * 1.2)];
}
const series = { speed: rows.speed, flow: rows.flow, tilt: Float32Array.from({ length: count }, (_, i) =>
  Math.acos(Math.min(1, rows.axes[i * 3 + 2] / 32767)) * 180 / Math.PI) };
const unit = { speed: "mm/s", flow: "mm³/s", tilt: "°" };
function top(values) {
  const kept = Array.from(values).filter((_, i) => rows.width[i] > 0).sort((a, b) => a - b);
  return kept.length ? kept[Math.floor(kept.length * 0.995)] || 1 : 1;
}
const scale = Object.fromEntries(Object.entries(series).map(([name, values]) => [name, top(values)]));

// ---- geometry
const beadRows = [], travelRows = [];
for (let i = 1; i < count; i++) (rows.width[i] > 0 ? beadRows : travelRows).push(i);
function beadVertices() {
  const data = new Float32Array(beadRows.length * 36);
  let at = 0;
  for (const i of beadRows) {
    const p = rows.points.subarray(i * 3 - 3, i * 3), e = rows.points.subarray(i * 3, i * 3 + 3);
    const n = [0, 1, 2].map((c) => rows.axes[i * 3 + c] / 32767);
    const d = [e[0] - p[0], e[1] - p[1], e[2] - p[2]];
    let s = [d[1] * n[2] - d[2] * n[1], d[2] * n[0] - d[0] * n[2], d[0] * n[1] - d[1] * n[0]];
    const long = Math.hypot(...s) || 1, half = rows.width[i] / 2;
    s = s.map((x) => x / long * half);
    const corner = (q, sign) => { for (let c = 0; c < 3; c++) data[at++] = q[c] + sign * s[c]; for (let c = 0; c < 3; c++) data[at++] = n[c] * 0.8 + sign * s[c] / half * 0.6; };
    corner(p, -1); corner(p, 1); corner(e, -1); corner(e, -1); corner(p, 1); corner(e, 1);
  }
  return data;
}
function beadColours(kind) {
  const data = new Float32Array(beadRows.length * 18);
  let at = 0;
  for (const i of beadRows) {
    const colour = kind === "role" ? roleColours[rows.role[i]] : ramp(series[kind][i] / scale[kind]);
    for (let v = 0; v < 6; v++) for (let c = 0; c < 3; c++) data[at++] = colour[c];
  }
  return data;
}
function solid(shape) { // triangles with normals in the shape's own frame
  const out = [], push = (p, n) => out.push(...p, ...n);
  const quad = (a, b, c, d) => {
    const u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]], v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const l = Math.hypot(...n) || 1, m = n.map((x) => x / l);
    for (const p of [a, b, c, a, c, d]) push(p, m);
  };
  if (shape.shape === "box") {
    const [a, b] = [shape.min, shape.max], c = (x, y, z) => [[a, b][x][0], [a, b][y][1], [a, b][z][2]];
    quad(c(0, 0, 0), c(0, 1, 0), c(1, 1, 0), c(1, 0, 0)); quad(c(0, 0, 1), c(1, 0, 1), c(1, 1, 1), c(0, 1, 1));
    quad(c(0, 0, 0), c(1, 0, 0), c(1, 0, 1), c(0, 0, 1)); quad(c(1, 1, 0), c(0, 1, 0), c(0, 1, 1), c(1, 1, 1));
    quad(c(0, 1, 0), c(0, 0, 0), c(0, 0, 1), c(0, 1, 1)); quad(c(1, 0, 0), c(1, 1, 0), c(1, 1, 1), c(1, 0, 1));
  } else if (shape.shape === "hull") {
    for (const [a, b, c] of shape.triangles) quad(a, b, c, c);
  } else {
    const r0 = (shape.diameter ?? shape.bottom_diameter) / 2, r1 = (shape.diameter ?? shape.top_diameter) / 2;
    const [x, y] = shape.center ?? [0, 0], steps = 40;
    const on = (r, i, z) => [x + r * Math.cos(i * 2 * Math.PI / steps), y + r * Math.sin(i * 2 * Math.PI / steps), z];
    for (let i = 0; i < steps; i++) {
      quad(on(r0, i, shape.bottom), on(r0, i + 1, shape.bottom), on(r1, i + 1, shape.top), on(r1, i, shape.top));
      quad([x, y, shape.top], on(r1, i, shape.top), on(r1, i + 1, shape.top), [x, y, shape.top]);
      quad([x, y, shape.bottom], on(r0, i + 1, shape.bottom), on(r0, i, shape.bottom), [x, y, shape.bottom]);
    }
  }
  return new Float32Array(out);
}

// ---- WebGL
const canvas = byId("view"), gl = canvas.getContext("webgl2", { antialias: true });
const vertexShader = `#version 300 es
in vec3 position; in vec3 normal; in vec3 colour; uniform mat4 clip, model; uniform float size; out vec3 shade;
void main() { gl_Position = clip * model * vec4(position, 1.0); gl_PointSize = size;
  vec3 n = mat3(model) * normal; float l = length(n);
  float light = l > 0.0 ? 0.45 + 0.55 * abs(dot(n / l, normalize(vec3(0.35, -0.5, 0.8)))) : 1.0; shade = colour * light; }`;
const fragmentShader = `#version 300 es
precision mediump float; in vec3 shade; uniform float alpha, ring; out vec4 pixel;
void main() { float r = ring > 0.0 ? length(gl_PointCoord * 2.0 - 1.0) : 0.0; if (r > 1.0) discard;
  pixel = vec4(r > 0.6 ? vec3(0.05) : shade, alpha); }`;
function program() {
  const p = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, fragmentShader]]) {
    const s = gl.createShader(kind); gl.shaderSource(s, text); gl.compileShader(s); gl.attachShader(p, s);
  }
  ["position", "normal", "colour"].forEach((name, i) => gl.bindAttribLocation(p, i, name));
  gl.linkProgram(p); gl.useProgram(p);
  return p;
}
function buffer(data) { const b = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW); return b; }
function attribute(place, source, stride, offset) {
  if (!source) { gl.disableVertexAttribArray(place); return; }
  gl.bindBuffer(gl.ARRAY_BUFFER, source); gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, 3, gl.FLOAT, false, stride, offset);
}
if (!gl) byId("stage").textContent = "This browser has no WebGL 2, which the 3D view needs; the plots and findings work without.";
const glProgram = gl && program(), place = (name) => gl.getUniformLocation(glProgram, name);
const uniforms = gl && Object.fromEntries(["clip", "model", "size", "alpha", "ring"].map((name) => [name, place(name)]));
const beads = gl && { shape: buffer(beadVertices()), colour: buffer(beadColours("role")) };
const travels = gl && buffer(Float32Array.from(travelRows.flatMap((i) => Array.from(rows.points.subarray(i * 3 - 3, i * 3 + 3)))));
const tool = gl && facts.tool.body.map((shape) => { const data = solid(shape); return { data: buffer(data), n: data.length / 6 }; });
const work = gl && facts.work.map((shape) => { const data = solid(shape); return { data: buffer(data), n: data.length / 6 }; });
const frame = gl && facts.bodies.map((body) => { const data = solid(body.solid); return { data: buffer(data), n: data.length / 6, side: body.side, joints: body.joints }; });
const cloud = gl && deviation && { points: buffer(deviation.points), colour: buffer(Float32Array.from(Array.from(deviation.value).flatMap((v) => {
  const t = Math.min(Math.max(v / facts.deviation.range, -1), 1);
  return t > 0 ? [0.95, 0.95 - 0.75 * t, 0.95 - 0.8 * t] : [0.95 + 0.8 * t, 0.95 + 0.6 * t, 0.95];
}))) };
const marks = facts.findings.filter((f) => f.point);
const markBuffer = gl && buffer(Float32Array.from(marks.flatMap((f) => f.point)));

const camera = { azimuth: -0.9, elevation: 0.6, distance: facts.size * 1.7, target: [...facts.middle] };
function clipMatrix(machineFromPart) {
  const { azimuth, elevation, distance, target } = camera;
  const centre = byId("frame").value === "machine" ? apply(machineFromPart, target, 1) : target;
  const away = [Math.cos(elevation) * Math.sin(azimuth), -Math.cos(elevation) * Math.cos(azimuth), Math.sin(elevation)];
  const right = [Math.cos(azimuth), Math.sin(azimuth), 0];
  const up = [away[1] * right[2] - away[2] * right[1], away[2] * right[0] - away[0] * right[2], away[0] * right[1] - away[1] * right[0]];
  const eye = centre.map((x, i) => x + away[i] * distance);
  const look = [right[0], up[0], away[0], 0, right[1], up[1], away[1], 0, right[2], up[2], away[2], 0,
    ...[right, up, away].map((v) => -(v[0] * eye[0] + v[1] * eye[1] + v[2] * eye[2])), 1];
  const near = distance / 50, far = distance * 20, f = 2.2, aspect = canvas.width / Math.max(canvas.height, 1);
  const lens = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
  return multiply(lens, look);
}
const ground = getComputedStyle(document.body).backgroundColor.match(/[\d.]+/g).slice(0, 3).map((c) => c / 255);
let now = duration, picked = null;
function draw() {
  drawPlots();
  const { row, q } = stateAt(now);
  byId("now").textContent = [
    `${now.toFixed(1)} s`, count ? `line ${rows.line[row]}` : "", joints.map((j, i) => `${j.letter} ${(q[i] * j.shown).toFixed(1)}`).join("  "),
    count ? `${rows.speed[row].toFixed(1)} mm/s, ${rows.flow[row].toFixed(2)} mm³/s` : "",
  ].join(" · ");
  if (!gl) return;
  const box = canvas.getBoundingClientRect(), ratio = devicePixelRatio || 1;
  canvas.width = Math.max(1, box.width * ratio); canvas.height = Math.max(1, box.height * ratio);
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(...ground, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
  const { machineFromPart, machineFromTool } = pose(q), inPart = byId("frame").value === "part";
  const partModel = inPart ? identity() : machineFromPart;
  const toolModel = inPart ? multiply(rigidInverse(machineFromPart), machineFromTool) : machineFromTool;
  gl.uniformMatrix4fv(uniforms.clip, false, clipMatrix(machineFromPart));
  gl.uniform1f(uniforms.alpha, 1); gl.uniformMatrix4fv(uniforms.model, false, partModel);
  const upTo = (list) => { let low = 0, high = list.length; while (low < high) { const mid = (low + high) >> 1; if (list[mid] <= row) low = mid + 1; else high = mid; } return low; };
  if (byId("beads").checked && !byId("deviation").checked) {
    attribute(0, beads.shape, 24, 0); attribute(1, beads.shape, 24, 12); attribute(2, beads.colour, 12, 0);
    gl.drawArrays(gl.TRIANGLES, 0, upTo(beadRows) * 6);
  }
  attribute(1, null); gl.vertexAttrib3f(1, 0, 0, 0);
  if (byId("travels").checked) {
    attribute(0, travels, 12, 0); attribute(2, null); gl.vertexAttrib3f(2, 0.4, 0.6, 0.75);
    gl.drawArrays(gl.LINES, 0, upTo(travelRows) * 2);
  }
  if (cloud && byId("deviation").checked) {
    attribute(0, cloud.points, 12, 0); attribute(2, cloud.colour, 12, 0); gl.uniform1f(uniforms.size, 2.5 * ratio);
    gl.drawArrays(gl.POINTS, 0, deviation.value.length);
  }
  if (marks.length) {
    gl.disable(gl.DEPTH_TEST); attribute(0, markBuffer, 12, 0); attribute(2, null); gl.uniform1f(uniforms.ring, 1);
    gl.vertexAttrib3f(2, 1, 1, 1); gl.uniform1f(uniforms.size, 9 * ratio); gl.drawArrays(gl.POINTS, 0, marks.length);
    if (picked?.point) {
      gl.vertexAttrib3f(2, 1, 0.85, 0); gl.uniform1f(uniforms.size, 22 * ratio); gl.drawArrays(gl.POINTS, marks.indexOf(picked), 1);
    }
    gl.uniform1f(uniforms.ring, 0); gl.enable(gl.DEPTH_TEST);
  }
  if (byId("machine").checked) {
    gl.enable(gl.BLEND); gl.enable(gl.CULL_FACE); gl.depthMask(false); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ZERO, gl.ONE); attribute(2, null);
    const toView = inPart ? rigidInverse(machineFromPart) : identity();
    const carried = frame.map((body) => [[body], multiply(toView, side(body.side, q, body.joints)), [0.45, 0.5, 0.55], 0.35]);
    for (const [bodies, model, colour, alpha] of [...carried, [work, partModel, [0.55, 0.57, 0.6], 0.3], [tool, toolModel, [0.75, 0.6, 0.35], 0.45]]) {
      gl.uniformMatrix4fv(uniforms.model, false, model); gl.uniform1f(uniforms.alpha, alpha); gl.vertexAttrib3f(2, ...colour);
      for (const body of bodies) { attribute(0, body.data, 24, 0); attribute(1, body.data, 24, 12); gl.drawArrays(gl.TRIANGLES, 0, body.n); }
    }
    gl.disable(gl.BLEND); gl.disable(gl.CULL_FACE); gl.depthMask(true);
  }
}

// ---- plots: every joint, tip speed, flow; the line is now
const plots = byId("plots"), plotted = [
  ...joints.map((j, i) => ({ name: `${j.letter} ${j.rotary ? "°" : "mm"}`, at: (r) => rows.joints[r * k + i] * j.shown })),
  { name: "tip mm/s", at: (r) => rows.speed[r] }, { name: "flow mm³/s", at: (r) => rows.flow[r] },
];
let plotImage = null;
function drawPlots() {
  const ratio = devicePixelRatio || 1, width = plots.clientWidth * ratio, height = plots.clientHeight * ratio;
  if (plots.width !== width || plots.height !== height || !plotImage) {
    plots.width = width; plots.height = height;
    const pen = plots.getContext("2d", { willReadFrequently: true }), band = height / plotted.length, ink = getComputedStyle(document.body).color;
    pen.font = `${11 * ratio}px system-ui`; pen.fillStyle = ink; pen.lineWidth = ratio;
    plotted.forEach((plot, b) => {
      const low = new Float32Array(width).fill(Infinity), high = new Float32Array(width).fill(-Infinity);
      let least = Infinity, most = -Infinity;
      for (let r = 0; r < count; r++) {
        const x = Math.min(Math.floor(rows.time[r] / (duration || 1) * (width - 1)), width - 1), v = plot.at(r);
        low[x] = Math.min(low[x], v); high[x] = Math.max(high[x], v); least = Math.min(least, v); most = Math.max(most, v);
      }
      const y = (v) => (b + 0.92) * band - (v - least) / (most - least || 1) * band * 0.84;
      pen.strokeStyle = `hsl(${b * 47 + 200} 55% 50%)`; pen.beginPath();
      let last = null;
      for (let x = 0; x < width; x++) if (high[x] >= low[x]) {
        if (last === null) pen.moveTo(x, y(low[x])); else pen.lineTo(x, y(low[x]));
        pen.lineTo(x, y(high[x])); last = x;
      }
      pen.stroke();
      pen.globalAlpha = 0.75; pen.fillStyle = getComputedStyle(document.body).backgroundColor;
      pen.fillRect(0, b * band, pen.measureText(`${plot.name}  ${least.toFixed(1)} … ${most.toFixed(1)}`).width + 12 * ratio, 15 * ratio);
      pen.globalAlpha = 1; pen.fillStyle = ink;
      pen.fillText(`${plot.name}  ${least.toFixed(1)} … ${most.toFixed(1)}`, 6 * ratio, b * band + 12 * ratio);
    });
    for (const finding of facts.findings.toReversed()) if (finding.time !== null) { // errors come first: on top
      const x = finding.time / (duration || 1) * (width - 1);
      pen.fillStyle = finding.severity === "error" ? "#d7263d" : "#e0a000";
      pen.beginPath(); pen.moveTo(x - 5 * ratio, height); pen.lineTo(x + 5 * ratio, height); pen.lineTo(x, height - 11 * ratio); pen.fill();
    }
    plotImage = pen.getImageData(0, 0, width, height);
  }
  const pen = plots.getContext("2d", { willReadFrequently: true });
  pen.putImageData(plotImage, 0, 0);
  pen.fillStyle = "#d7263d"; pen.fillRect(now / (duration || 1) * (plots.width - 1), 0, ratio, plots.height);
}

// ---- controls
function goTo(time) { now = Math.min(Math.max(time, 0), duration); byId("time").value = duration ? now / duration * 1e6 : 0; draw(); }
function legend() {
  const kind = byId("colour").value;
  byId("legend").innerHTML = byId("deviation").checked
    ? `<span style="background:#3359f2"></span>${facts.deviation.range.toFixed(2)} mm below<span style="background:#f23326"></span>${facts.deviation.range.toFixed(2)} mm above`
    : kind === "role"
      ? facts.roles.filter((role) => role.present).map((role) => `<span style="background:#${role.colour}"></span>${role.name}`).join("")
      : [0, 0.5, 1].map((t) => `<span style="background:rgb(${ramp(t).map((c) => c * 255)})"></span>${(t * scale[kind]).toFixed(1)} ${unit[kind]}`).join("");
}
byId("time").addEventListener("input", (event) => goTo(event.target.value / 1e6 * duration));
byId("colour").addEventListener("change", (event) => { if (gl) beads.colour = buffer(beadColours(event.target.value)); legend(); draw(); });
for (const name of ["machine", "beads", "travels", "deviation", "frame"]) byId(name).addEventListener("change", () => { legend(); draw(); });
byId("deviation-label").hidden = !deviation;
let playing = false, before = 0;
function tick(at) {
  if (!playing) return;
  goTo(now + (at - before) / 1000 * byId("rate").value); before = at;
  if (now >= duration) play(false); else requestAnimationFrame(tick);
}
function play(on) {
  playing = on; byId("play").textContent = on ? "⏸" : "▶"; byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
  if (on) { if (now >= duration) goTo(0); before = performance.now(); requestAnimationFrame(tick); }
}
byId("play").addEventListener("click", () => play(!playing));
plots.addEventListener("pointerdown", (event) => goTo(event.offsetX / plots.clientWidth * duration));
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!event.buttons) return;
  if (event.shiftKey || event.buttons === 2) {
    const s = camera.distance / canvas.clientHeight, a = camera.azimuth;
    camera.target[0] -= Math.cos(a) * event.movementX * s; camera.target[1] -= Math.sin(a) * event.movementX * s;
    camera.target[2] += event.movementY * s;
  } else {
    camera.azimuth -= event.movementX * 0.008;
    camera.elevation = Math.min(1.55, Math.max(-1.55, camera.elevation + event.movementY * 0.008));
  }
  draw();
});
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => { event.preventDefault(); camera.distance *= Math.exp(event.deltaY * 0.001); draw(); }, { passive: false });
canvas.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
  if (!step) return;
  event.preventDefault(); camera.azimuth += step[0]; camera.elevation = Math.min(1.55, Math.max(-1.55, camera.elevation + step[1])); draw();
});
for (const finding of facts.findings) {
  const item = document.createElement("li"), button = document.createElement("button");
  button.textContent = `${finding.code}: ${finding.line ? `line ${finding.line}: ` : ""}${finding.message}`;
  button.className = finding.severity;
  button.addEventListener("click", () => {
    picked = finding;
    byId("list").querySelector("[aria-current]")?.removeAttribute("aria-current");
    button.setAttribute("aria-current", "true");
    if (finding.point) { camera.target = [...finding.point]; camera.distance = Math.min(camera.distance, facts.size * 0.7); }
    goTo(finding.time ?? now);
  });
  item.append(button); byId("list").append(item);
}
if (!facts.findings.length) byId("list").outerHTML = "<p>None.</p>";
addEventListener("resize", () => { plotImage = null; draw(); });
legend();
goTo(duration);
document.body.dataset.ready = "yes";

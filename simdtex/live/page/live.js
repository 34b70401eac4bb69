// SPDX-License-Identifier: BSD-3-Clause
// The live page of simdtex: in a browser beside `simdtex live`, and in a notebook as the widget simdtex.Live.
// All arithmetic on textures is done by simdtex; the page shows frames and sends wishes.

const LABELS = [
  { name: "1", colour: "#e69f00" },
  { name: "2", colour: "#56b4e9" },
  { name: "3", colour: "#009e73" },
  { name: "4", colour: "#f0e442" },
  { name: "5", colour: "#cc79a7" },
]; // of Okabe and Ito, told apart by most eyes
const HOLE = "#ff1e9b";
const LAYERS = {
  picture: "Picture",
  sample: "Sample",
  arrangement: "Where from (arrangement)",
  use: "Use of the sample",
  temperature: "Temperature",
};
const JOBS = { synth: "More of it", tile: "The picture without a seam", fill: "A hole that is filled" };
const BUTTONS = { synth: "Make it", tile: "Make it seamless", fill: "Fill the hole" };
const LARGEST = 2 ** 22; // pixels of a window, at most
const STARTING_SIDE = 512;

// -- connections --------------------------------------------------------------------------------------------------

/** A WebSocket to `simdtex live`; it comes back when it was lost. */
class Socket {
  constructor(address) {
    this.address = address;
    this.wait = 250;
    this.onmessage = this.onstate = () => {};
  }

  open() {
    const key = sessionStorage.getItem("simdtex-session");
    this.socket = new WebSocket(`${this.address}${key ? `?session=${encodeURIComponent(key)}` : ""}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.wait = 250;
      this.onstate("open", "");
    };
    this.socket.onclose = (event) => {
      this.onstate("lost", event.reason);
      this.timer = setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, 4000);
    };
    this.socket.onmessage = (event) => {
      const length = new DataView(event.data).getUint32(0, true);
      const message = JSON.parse(new TextDecoder().decode(new Uint8Array(event.data, 4, length)));
      let at = 4 + length;
      const buffers = message.buffers.map((size) => {
        at += size;
        return new Uint8Array(event.data, at - size, size);
      });
      if (message.kind === "session") sessionStorage.setItem("simdtex-session", message.key);
      else this.onmessage(message, buffers);
    };
  }

  send(message, buffers = []) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    const text = new TextEncoder().encode(JSON.stringify({ ...message, buffers: buffers.map((one) => one.byteLength) }));
    const head = new Uint8Array(4);
    new DataView(head.buffer).setUint32(0, text.length, true);
    this.socket.send(new Blob([head, text, ...buffers]));
  }

  close() {
    clearTimeout(this.timer);
    this.socket.onclose = null;
    this.socket.close();
  }
}

/** The connection of a notebook to its kernel. */
class Kernel {
  constructor(model) {
    this.model = model;
    this.onmessage = this.onstate = () => {};
    this.heard = (message, buffers) =>
      this.onmessage(message, (buffers ?? []).map((one) => new Uint8Array(one.buffer, one.byteOffset, one.byteLength)));
  }

  open() {
    this.model.on("msg:custom", this.heard);
    this.onstate("open", "");
  }

  send(message, buffers = []) {
    this.model.send(message, undefined, buffers);
  }

  close() {
    this.model.off("msg:custom", this.heard);
  }
}

// -- elements -----------------------------------------------------------------------------------------------------

let count = 0;

/** An element with attributes, listeners (`onclick`) and children. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else if (value !== undefined && value !== null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** A control and its label. */
function labelled(text, control, hint = "") {
  control.id ||= `simdtex-${++count}`;
  const parts = [make("label", { for: control.id }, text), control];
  if (hint) {
    const note = make("small", { id: `${control.id}-hint` }, hint);
    control.setAttribute("aria-describedby", note.id);
    parts.push(note);
  }
  return make("div", { class: "field" }, ...parts);
}

function number(attributes) {
  return make("input", { type: "number", ...attributes });
}

function choice(pairs, onchange) {
  return make("select", { onchange }, ...pairs.map(([value, text]) => make("option", { value }, text)));
}

/** RGBA bytes as something that a canvas draws. */
function bitmap(bytes, width, height) {
  const canvas = make("canvas");
  [canvas.width, canvas.height] = [width, height];
  const data = new ImageData(new Uint8ClampedArray(bytes.buffer, bytes.byteOffset, 4 * width * height), width, height);
  canvas.getContext("2d").putImageData(data, 0, 0);
  return canvas;
}

// -- options ------------------------------------------------------------------------------------------------------

/** The controls of a method, made of what simdtex says of its options. */
class Options {
  constructor(controls, onchange) {
    this.controls = controls;
    this.fields = new Map();
    this.element = make("div", {});
    const groups = new Map();
    for (const control of controls) {
      if (!groups.has(control.group)) {
        const open = groups.size === 0;
        groups.set(control.group, make("details", { open }, make("summary", {}, control.group)));
      }
      groups.get(control.group).append(this.field(control, onchange));
    }
    this.element.append(...groups.values());
  }

  field(control, onchange) {
    if (control.kind === "words" || control.kind === "switch") {
      const input =
        control.kind === "words"
          ? choice(control.valid, onchange)
          : make("input", { type: "checkbox", onchange });
      const get = () => (control.kind === "words" ? input.value : input.checked);
      const set = (value) => (control.kind === "words" ? (input.value = value) : (input.checked = value));
      this.fields.set(control.name, { get, set });
      set(control.default ?? false);
      return labelled(control.label, input, control.hint);
    }
    const [least, most, step] = control.span;
    const input = number({ step: "any", min: control.least, placeholder: control.empty || null, onchange });
    const slider = make("input", { type: "range", min: least, max: most, step, "aria-label": `${control.label}, slider` });
    const show = () => (slider.value = input.value === "" ? (control.default ?? least) : input.value);
    slider.addEventListener("input", () => (input.value = slider.value));
    slider.addEventListener("change", onchange);
    input.addEventListener("input", show);
    const get = () => (input.value === "" ? control.blank : Number(input.value));
    const set = (value) => {
      input.value = value === null || value === undefined || value === control.blank ? "" : value;
      show();
    };
    this.fields.set(control.name, { get, set });
    set(control.default);
    const field = labelled(control.label, input, control.hint);
    input.after(slider);
    return field;
  }

  /** The options that differ from what they are by default. */
  get values() {
    const found = {};
    for (const control of this.controls) {
      const value = this.fields.get(control.name).get();
      if (value !== null && value !== undefined && value !== control.default) found[control.name] = value;
    }
    return found;
  }

  set values(given) {
    for (const control of this.controls) this.fields.get(control.name).set(given[control.name] ?? control.default);
  }
}

// -- the view -----------------------------------------------------------------------------------------------------

/** A window of a plane, at whole pixels: the server sends what is seen and no more, so memory has a bound. */
class View {
  constructor(page) {
    this.page = page;
    this.left = this.top = 0;
    this.scale = 1; // above 0 pixels of the screen for each of the plane, below 0 the other way round
    this.fitted = true;
    this.rows = this.cols = 0;
    this.frame = null;
    this.cursor = null;
    this.canvas = make("canvas", { class: "view", tabindex: 0, role: "img", "aria-label": "Nothing is made yet." });
    this.observer = new ResizeObserver(() => this.resized());
    this.observer.observe(this.canvas);
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  get unit() {
    return this.scale > 0 ? this.scale : -1 / this.scale;
  }

  get step() {
    return this.scale > 0 ? 1 : -this.scale;
  }

  resized() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((side) => Math.round(side * ratio));
    if (!width || (width === this.canvas.width && height === this.canvas.height)) return;
    [this.canvas.width, this.canvas.height] = [width, height];
    if (this.fitted) this.fit();
    else this.moved();
  }

  fit() {
    this.fitted = true;
    const times = this.page.tiled ? 3 : 1;
    const room = Math.min(this.canvas.width / (times * this.cols), this.canvas.height / (times * this.rows));
    if (!this.cols || !Number.isFinite(room)) return;
    this.scale = room >= 1 ? Math.floor(room) : -Math.ceil(1 / room);
    this.left = Math.floor((this.cols - this.canvas.width / this.unit) / 2);
    this.top = Math.floor((this.rows - this.canvas.height / this.unit) / 2);
    this.moved();
  }

  zoom(by, x = this.canvas.width / 2, y = this.canvas.height / 2) {
    const [col, row] = [this.left + x / this.unit, this.top + y / this.unit];
    let scale = this.scale + by;
    if (scale > -2 && scale < 1) scale = by > 0 ? 1 : -2;
    this.scale = Math.max(-64, Math.min(64, scale));
    this.left = Math.round(col - x / this.unit);
    this.top = Math.round(row - y / this.unit);
    this.fitted = false;
    this.moved();
  }

  pan(cols, rows) {
    this.left += cols;
    this.top += rows;
    this.fitted = false;
    this.moved();
  }

  /** Ask for what is seen now. */
  moved() {
    this.draw();
    clearTimeout(this.asking);
    this.asking = setTimeout(() => this.ask(), 15);
  }

  ask() {
    const { step } = this;
    const across = this.canvas.width / this.unit / step;
    const down = this.canvas.height / this.unit / step;
    const width = Math.max(1, Math.min(4096, Math.ceil(across) + 1));
    const height = Math.max(1, Math.min(Math.floor(LARGEST / width), Math.ceil(down) + 1));
    const { layer, tiled } = this.page;
    this.page.send({ kind: "look", layer, left: this.left, top: this.top, width, height, step, tiled });
    this.page.zoomed.textContent = this.scale > 0 ? `${100 * this.scale} %` : `1 : ${-this.scale}`;
  }

  show(message, bytes) {
    this.frame = { ...message, picture: message.width && message.height ? bitmap(bytes, message.width, message.height) : null };
    if (message.rows !== this.rows || message.cols !== this.cols) {
      [this.rows, this.cols] = [message.rows, message.cols];
      if (this.fitted) this.fit();
    }
    this.draw();
  }

  draw() {
    if (this.drawing) return;
    this.drawing = requestAnimationFrame(() => {
      this.drawing = null;
      this.paint();
    });
  }

  paint() {
    const context = this.canvas.getContext("2d");
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    const { frame, unit } = this;
    if (!frame) return;
    context.imageSmoothingEnabled = false;
    if (frame.picture) {
      const size = frame.step * unit;
      const [x, y] = [(frame.left - this.left) * unit, (frame.top - this.top) * unit];
      context.drawImage(frame.picture, x, y, frame.width * size, frame.height * size);
    }
    for (const { strokes, colour } of this.page.painted()) this.strokes(context, strokes, colour);
    const { cursor } = this;
    if (cursor && this.page.brush) {
      context.globalAlpha = 1;
      context.lineWidth = 2;
      for (const [colour, more] of [["#000", 1], ["#fff", -1]]) {
        context.strokeStyle = colour;
        context.beginPath();
        const radius = Math.max(3, (this.page.brush.width * unit) / 2 + more);
        context.arc((cursor[0] - this.left) * unit, (cursor[1] - this.top) * unit, radius, 0, 7);
        context.stroke();
      }
    }
  }

  strokes(context, strokes, colour) {
    const layer = document.createElement("canvas"); // of its own, so that strokes over one another are not darker
    [layer.width, layer.height] = [this.canvas.width, this.canvas.height];
    const on = layer.getContext("2d");
    on.lineCap = on.lineJoin = "round";
    for (const stroke of strokes) {
      on.globalCompositeOperation = stroke.label === 0 ? "destination-out" : "source-over";
      on.strokeStyle = colour(stroke.label);
      on.lineWidth = Math.max(1, stroke.width * this.unit);
      on.beginPath();
      const points = stroke.points.length > 1 ? stroke.points : [stroke.points[0], stroke.points[0]];
      points.forEach(([x, y], index) => {
        const at = [(x + 0.5 - this.left) * this.unit, (y + 0.5 - this.top) * this.unit];
        if (index) on.lineTo(...at);
        else on.moveTo(...at);
      });
      on.stroke();
    }
    context.globalAlpha = 0.6;
    context.drawImage(layer, 0, 0);
    context.globalAlpha = 1;
  }

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    const ratio = this.canvas.width / box.width;
    return [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
  }

  press(event) {
    if (event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    const brush = this.page.brush;
    let [x, y] = this.place(event);
    const at = () => [this.left + x / this.unit, this.top + y / this.unit].map((one) => Math.round(10 * (one - 0.5)) / 10);
    if (brush) brush.begin(at());
    const move = (now) => {
      const [toX, toY] = this.place(now);
      if (brush) {
        [x, y] = [toX, toY];
        brush.go(at());
        this.draw();
        return;
      }
      const [cols, rows] = [(x - toX) / this.unit, (y - toY) / this.unit].map(Math.round);
      if (!cols && !rows) return;
      [x, y] = [x - cols * this.unit, y - rows * this.unit];
      this.pan(cols, rows);
    };
    const end = () => {
      this.canvas.removeEventListener("pointermove", move);
      for (const kind of ["pointerup", "pointercancel"]) this.canvas.removeEventListener(kind, end);
      if (brush) brush.end();
    };
    this.canvas.addEventListener("pointermove", move);
    for (const kind of ["pointerup", "pointercancel"]) this.canvas.addEventListener(kind, end);
    this.draw();
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(event.deltaY < 0 ? 1 : -1, ...this.place(event));
  }

  key(event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const brush = this.page.brush;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in ways) {
      const [x, y] = ways[event.key];
      if (brush) {
        const by = Math.max(1, Math.round(brush.width / 4)) * (event.shiftKey ? 4 : 1);
        const [col, row] = this.cursor ?? [this.cols / 2, this.rows / 2];
        const inside = (value, most) => Math.max(0, Math.min(most - 1, value));
        this.cursor = [inside(col + x * by, this.cols), inside(row + y * by, this.rows)];
        if (this.down) brush.go([...this.cursor]);
        this.draw();
      } else {
        const by = Math.max(1, Math.round(32 / this.unit));
        this.pan(x * by, y * by);
      }
    } else if (event.key === " " && brush) {
      this.cursor ??= [this.cols / 2, this.rows / 2];
      this.down = !this.down;
      if (this.down) brush.begin([...this.cursor]);
      else brush.end();
      this.draw();
    } else if (event.key === "+" || event.key === "=") this.zoom(1);
    else if (event.key === "-") this.zoom(-1);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
    event.stopPropagation(); // a notebook has other plans with keys
  }

  close() {
    this.observer.disconnect();
  }
}

// -- the page -----------------------------------------------------------------------------------------------------

class Page {
  constructor(root, connection) {
    this.connection = connection;
    this.results = new Map();
    this.shown = null; // the number of the result that is looked at
    this.picture = null;
    this.given = null; // the file, to give it again to a server that has forgotten it
    this.guide = { sample: [], output: [] };
    this.hole = [];
    this.part = null;
    this.layer = "picture";
    this.tiled = false;
    this.running = this.stopped = false;
    this.build(root);
    connection.onmessage = (message, buffers) => this[`on_${message.kind}`]?.(message, buffers);
    connection.onstate = (state, reason) => this.connected(state, reason);
    connection.open();
  }

  send(message, buffers) {
    this.connection.send(message, buffers);
  }

  build(root) {
    this.view = null;
    this.status = make("p", { role: "status", class: "status" }, "Connecting …");
    this.alert = make("p", { role: "alert", class: "alert", hidden: true });
    this.device = make("p", { class: "device" });
    const main = make("div", { class: "columns" }, this.sampleSection(), this.resultSection(), this.optionsSection());
    const header = make("header", {}, make("h1", {}, "simdtex live"), this.device, this.status);
    this.root = make("main", { class: "simdtex", "data-lm-suppress-shortcuts": "true" }, header, this.alert, main);
    root.replaceChildren(this.root);
    this.root.addEventListener("dragover", (event) => event.preventDefault());
    this.root.addEventListener("drop", (event) => {
      event.preventDefault();
      const [file] = event.dataTransfer.files;
      if (file) this.open(file, event.target.closest?.(".maps") ? "map" : "open");
    });
    this.paste = (event) => {
      const file = [...(event.clipboardData?.files ?? [])][0];
      if (file) this.open(file, "open");
    };
    (root.id === "simdtex-live" ? document : this.root).addEventListener("paste", this.paste);
  }

  // -- sample

  sampleSection() {
    this.file = make("input", { type: "file", accept: "image/*,.tif,.tiff,.npy", "aria-label": "A picture", onchange: () => this.chosen(this.file, "open") });
    this.mapFile = make("input", { type: "file", accept: "image/*,.tif,.tiff,.npy", "aria-label": "A further map", onchange: () => this.chosen(this.mapFile, "map") });
    this.examples = make("p", { class: "bar" });
    this.preview = make("canvas", { class: "preview", role: "img", "aria-label": "There is no picture yet." });
    this.preview.addEventListener("pointerdown", (event) => this.select(event));
    const change = () => this.partTyped();
    this.partFields = Object.fromEntries(
      ["left", "top", "width", "height"].map((name) => [name, number({ min: 0, step: 1, onchange: change })]),
    );
    const fields = Object.entries(this.partFields).map(([name, input]) => labelled(name[0].toUpperCase() + name.slice(1), input));
    const all = make("button", { type: "button", onclick: () => this.setPart(null) }, "All of it");
    this.partSet = make("fieldset", { class: "part", hidden: true }, make("legend", {}, "The part that is the sample, in pixels"), ...fields, all);
    this.mapList = make("ul");
    this.maps = make("details", { class: "maps", hidden: true }, make("summary", {}, "Further maps of the material"), make("p", {}, "Normal, height, roughness: they are carried along."), this.mapFile, this.mapList);
    this.named = make("p", { class: "named" }, "Drop a picture anywhere, paste one, or choose a file.");
    return make("section", { "aria-label": "Sample", class: "sample" }, make("h2", {}, "Sample"), this.named, this.file, this.examples, this.preview, this.partSet, this.maps);
  }

  chosen(input, kind) {
    const [file] = input.files;
    if (file) this.open(file, kind);
    input.value = "";
  }

  async open(file, kind) {
    if (this.bytes && file.size > this.bytes) {
      this.tell(`The file has ${file.size} bytes and ${this.bytes} are taken at most; give a smaller one.`);
      return;
    }
    const bytes = new Uint8Array(await file.arrayBuffer());
    if (kind === "open") this.given = { name: file.name, bytes };
    this.send({ kind, name: file.name || "pasted.png" }, [bytes]);
  }

  on_picture(message, [bytes]) {
    this.picture = message;
    this.small = bitmap(bytes, ...message.shown);
    [this.preview.width, this.preview.height] = message.shown;
    this.preview.setAttribute("aria-label", `${message.name}, ${message.width} by ${message.height} pixels. Drag over it to choose the part that is the sample.`);
    this.named.textContent = `${message.name}, ${message.width} × ${message.height}, ${message.values}`;
    this.partSet.hidden = this.maps.hidden = false;
    this.on_maps({ names: message.maps });
    this.part = message.part;
    this.showPart();
    if (!message.new) return;
    this.guide = { sample: [], output: [] };
    this.hole = [];
    this.results.forEach((_, number) => this.mark(number, false));
    this.shown = null;
    const { width, height } = this.sampleSize;
    if (this.again) this.restore(this.again);
    else {
      this.width.value = Math.min(2 * width, STARTING_SIDE);
      this.height.value = Math.min(2 * height, STARTING_SIDE);
    }
    this.again = null;
    this.settle();
    if (this.job.value !== "fill") this.make();
    else this.look("sample");
  }

  get sampleSize() {
    return this.part ? { width: this.part[2], height: this.part[3] } : this.picture;
  }

  showPart() {
    const { width, height } = this.picture;
    const [x, y, w, h] = this.part ?? [0, 0, width, height];
    Object.entries({ left: x, top: y, width: w, height: h }).forEach(([name, value]) => (this.partFields[name].value = value));
    const context = this.preview.getContext("2d");
    const { step } = this.picture;
    context.globalAlpha = 1;
    context.drawImage(this.small, 0, 0);
    if (!this.part) return;
    context.globalAlpha = 0.6;
    context.fillStyle = "#000";
    context.fillRect(0, 0, this.preview.width, this.preview.height);
    context.globalAlpha = 1;
    context.drawImage(this.small, x / step, y / step, w / step, h / step, x / step, y / step, w / step, h / step);
  }

  setPart(part, wish = true) {
    const { width, height } = this.picture;
    this.part = part && part[2] === width && part[3] === height ? null : part;
    this.showPart();
    if (wish) this.changed();
  }

  partTyped() {
    const { width, height } = this.picture;
    const found = ["left", "top", "width", "height"].map((name) => Math.round(Number(this.partFields[name].value)));
    const least = (side) => Math.min(8, side);
    const w = Math.max(least(width), Math.min(width, found[2]));
    const h = Math.max(least(height), Math.min(height, found[3]));
    this.setPart([Math.max(0, Math.min(width - w, found[0])), Math.max(0, Math.min(height - h, found[1])), w, h]);
  }

  select(event) {
    if (!this.picture || event.button !== 0) return;
    this.preview.setPointerCapture(event.pointerId);
    const box = this.preview.getBoundingClientRect();
    const place = (now) => [
      Math.round(Math.max(0, Math.min(1, (now.clientX - box.left) / box.width)) * this.picture.width),
      Math.round(Math.max(0, Math.min(1, (now.clientY - box.top) / box.height)) * this.picture.height),
    ];
    const [x, y] = place(event);
    const before = this.part;
    const move = (now) => {
      const [toX, toY] = place(now);
      const part = [Math.min(x, toX), Math.min(y, toY), Math.abs(toX - x), Math.abs(toY - y)];
      if (part[2] >= 8 && part[3] >= 8) this.setPart(part, false);
    };
    const end = () => {
      this.preview.removeEventListener("pointermove", move);
      if (this.part !== before) this.changed();
    };
    this.preview.addEventListener("pointermove", move);
    this.preview.addEventListener("pointerup", end, { once: true });
  }

  on_maps({ names }) {
    this.mapNames = names;
    const item = (name) =>
      make("li", {}, `${name} `, make("button", { type: "button", "aria-label": `Take ${name} away`, onclick: () => this.send({ kind: "unmap", name }) }, "×"));
    this.mapList.replaceChildren(...names.map(item));
    if (names.length && this.shown !== null) this.make();
  }

  // -- result

  resultSection() {
    this.view = new View(this);
    this.layerChoice = choice(Object.entries(LAYERS), () => this.look(this.layerChoice.value));
    this.tiling = make("input", { type: "checkbox", onchange: () => this.tile() });
    this.zoomed = make("output", { "aria-label": "Zoom" }, "100 %");
    const zoom = (text, label, by) => make("button", { type: "button", "aria-label": label, onclick: () => by() }, text);
    const looking = make(
      "div",
      { class: "bar" },
      labelled("Look at", this.layerChoice),
      labelled("Tiled 3 × 3", this.tiling),
      make("span", { class: "bar" }, zoom("−", "Zoom out", () => this.view.zoom(-1)), this.zoomed, zoom("+", "Zoom in", () => this.view.zoom(1)), zoom("Fit", "Fit", () => this.view.fit())),
    );
    this.progress = make("progress", { max: 1, value: 0, "aria-label": "Progress" });
    this.doing = make("p", { class: "doing" });
    this.stopping = make("button", { type: "button", disabled: true, onclick: () => this.stop() }, "Stop");
    this.ending = make("button", { type: "button", disabled: true, onclick: () => this.send({ kind: "end" }) }, "Give up");
    const running = make("div", { class: "bar" }, this.stopping, this.ending, this.progress);
    this.current = make("button", { type: "button", onclick: () => this.send({ kind: "choose", result: null }) }, "What is being made");
    this.currentItem = make("li", { class: "current", hidden: true }, this.current);
    this.strip = make("ol", { class: "strip", "aria-label": "Results" }, this.currentItem);
    this.takes = make("div", { class: "bar" });
    this.command = make("pre", { tabindex: 0, "aria-label": "Command line" });
    this.python = make("pre", { tabindex: 0, "aria-label": "Python" });
    const copy = (of, what) => make("button", { type: "button", onclick: () => this.copy(of.textContent) }, `Copy the ${what}`);
    this.away = make(
      "section",
      { "aria-label": "Take away", hidden: true },
      make("h3", {}, "Take it away"),
      this.takes,
      make("p", {}, "These lines make the same bytes, from the files in the package:"),
      this.command,
      copy(this.command, "command line"),
      this.python,
      copy(this.python, "lines of Python"),
    );
    this.figures = make("dl", { class: "figures" });
    this.quality = make("section", { "aria-label": "Quality", hidden: true }, make("h3", {}, "Figures of quality"), this.figures);
    return make("section", { "aria-label": "Result", class: "result" }, make("h2", {}, "Result"), looking, this.view.canvas, running, this.doing, this.paintSet(), this.strip, this.away, this.quality);
  }

  look(layer) {
    this.layer = layer;
    this.layerChoice.value = layer;
    this.view.moved();
    this.view.ask();
  }

  tile() {
    this.tiled = this.tiling.checked;
    this.view.fit();
  }

  on_frame(message, [bytes]) {
    this.send({ kind: "seen" });
    this.seen = message.layer;
    this.view.show(message, bytes);
    if (message.fraction === undefined) return;
    this.progress.value = message.fraction;
    if (this.watching) this.doing.textContent = message.doing;
    this.frames = (this.frames ?? 0) + 1;
  }

  on_progress({ fraction }) {
    this.progress.value = fraction;
  }

  /** Offer these to be looked at. */
  offer(layers) {
    const text = (name) => LAYERS[name] ?? name.replace(/^map /, "Map: ");
    this.layerChoice.replaceChildren(...layers.map((name) => make("option", { value: name }, text(name))));
    if (!layers.includes(this.layer)) this.look("picture");
    this.layerChoice.value = this.layer;
  }

  on_begun(message) {
    this.running = true;
    this.offered = message.layers;
    this.stopped = false;
    this.frames = 0;
    this.say(message.from === null ? "It is being made." : `It goes on after level ${message.from}, where it begins to differ.`);
    this.progress.value = 0;
    this.alert.hidden = true;
    this.showRunning();
    this.mark(this.shown, false);
    this.shown = null;
    this.mark(null, true);
    this.offer(this.offered);
    if (this.layer === "sample") this.look("picture");
  }

  on_ended() {
    this.running = this.stopped = false;
    this.say("It was given up.");
    this.showRunning();
  }

  on_result(message, [bytes]) {
    this.running = this.stopped = false;
    this.results.set(message.result, message);
    for (const number of message.gone) {
      this.results.get(number)?.item?.remove();
      this.results.delete(number);
    }
    const button = make("button", { type: "button", onclick: () => this.send({ kind: "choose", result: message.result }) });
    const small = bitmap(bytes, ...message.thumbnail);
    const text = `Result ${message.result}, ${message.width} × ${message.height}, seed ${message.asked.seed}`;
    small.setAttribute("aria-hidden", "true");
    button.append(small, make("span", {}, text));
    message.item = make("li", {}, button);
    message.button = button;
    this.currentItem.before(message.item);
    this.strip.scrollLeft = this.strip.scrollWidth;
    if (message.chosen && message.asked.job === "fill") this.hole = [];
    if (message.chosen) this.on_chosen({ result: message.result }, false);
    this.say(`Result ${message.result} is made: ${this.summary(message)}.`);
    this.progress.value = 1;
    this.showRunning();
  }

  summary(result) {
    return `${result.width} × ${result.height} in ${result.seconds.toFixed(2)} s on ${result.device}, seed ${result.asked.seed}`;
  }

  on_chosen({ result }, restore = true) {
    this.mark(this.shown, false);
    this.shown = result;
    const found = this.results.get(result);
    this.away.hidden = this.quality.hidden = !found;
    this.mark(result, true);
    if (!found && this.running) this.offer(this.offered);
    if (!found) return;
    this.doing.textContent = this.summary(found);
    this.offer(found.layers);
    this.view.canvas.setAttribute("aria-label", `Result ${result}: ${this.summary(found)}. Arrow keys move, plus and minus zoom, 0 fits.`);
    this.command.textContent = found.command;
    this.python.textContent = found.python;
    const take = (what, text) => make("button", { type: "button", "data-what": what, onclick: () => this.send({ kind: "take", result, what }) }, text);
    const buttons = [take("picture", "Picture"), take("tif", "TIFF")];
    if (found.arrangement) buttons.push(take("arrangement", "Arrangement"));
    for (const name of found.maps) buttons.push(take(`map ${name}`, `Map: ${name}`));
    this.takes.replaceChildren(...buttons, take("all", "Everything (.zip)"));
    this.on_quality(found);
    if (restore) this.restore(found.asked);
  }

  mark(number, current) {
    const button = number === null ? this.current : this.results.get(number)?.button;
    if (current) button?.setAttribute("aria-current", "true");
    else button?.removeAttribute("aria-current");
  }

  on_quality({ result, figures }) {
    const found = this.results.get(result);
    if (!found) return;
    found.figures = figures;
    if (result !== this.shown) return;
    this.quality.hidden = figures.length === 0;
    this.figures.replaceChildren(
      ...figures.flatMap(({ label, hint, value }) => [make("dt", {}, label), make("dd", {}, value === null ? "–" : Number(value).toPrecision(3), " ", make("small", {}, hint))]),
    );
  }

  on_file({ name }, [bytes]) {
    const address = URL.createObjectURL(new Blob([bytes]));
    make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60000);
    this.say(`${name} is taken away.`);
  }

  async copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      this.say("Copied.");
    } catch {
      this.tell("The browser does not allow copying here; select the text instead.");
    }
  }

  stop() {
    this.stopped = !this.stopped;
    this.send({ kind: this.stopped ? "stop" : "go" });
    this.say(this.stopped ? "It is stopped." : "It goes on.");
    this.showRunning();
  }

  showRunning() {
    this.stopping.disabled = this.ending.disabled = !this.running;
    this.stopping.textContent = this.stopped ? "Go on" : "Stop";
    this.currentItem.hidden = !this.running;
  }

  // -- painting

  paintSet() {
    const tools = [["", "Nothing: look around"], ["hole", "A hole to fill"], ...LABELS.map(({ name }) => [`label ${name}`, `Label ${name}`]), ["erase", "Rubber"]];
    this.tool = choice(tools, () => this.toolChanged());
    this.brushWidth = number({ min: 1, max: 1024, step: 1, value: 16 });
    const undo = make("button", { type: "button", onclick: () => this.undo() }, "Undo");
    const clear = make("button", { type: "button", onclick: () => this.clear() }, "Clear all");
    const hint =
      "Labels say where what is to be: paint them on the sample, and on the result. With the keyboard, arrow keys move the brush and the space bar puts it down and lifts it.";
    return make(
      "details",
      { class: "paint" },
      make("summary", {}, "Paint a hole, or where what is to be"),
      make("div", { class: "bar" }, labelled("Paint", this.tool), labelled("Brush, pixels", this.brushWidth), undo, clear),
      make("p", {}, hint),
    );
  }

  toolChanged() {
    if (this.tool.value === "hole" && this.job.value !== "fill") {
      this.job.value = "fill";
      this.settle();
    }
    this.view.draw();
  }

  /** Where a stroke goes that is painted now. */
  get surface() {
    const onSample = this.seen === "sample";
    if (this.tool.value === "hole" || (this.tool.value === "erase" && this.job.value === "fill")) return this.hole;
    return onSample ? this.guide.sample : this.guide.output;
  }

  /** Whether a run is looked at, on which nobody paints. */
  get watching() {
    return this.running && this.shown === null;
  }

  get brush() {
    const tool = this.tool.value;
    if (!tool || !["sample", "picture"].includes(this.seen) || this.watching) return null;
    const width = Math.max(1, Number(this.brushWidth.value) || 16);
    const label = tool === "erase" ? 0 : tool === "hole" ? 1 : Number(tool.slice(6));
    const { surface } = this;
    return {
      width,
      begin: (point) => surface.push({ label, width, points: [point] }),
      go: (point) => surface.at(-1)?.points.push(point),
      end: () => {
        if (surface !== this.hole && this.guide.sample.length && this.guide.output.length) this.changed();
      },
    };
  }

  /** What is painted over what is seen. */
  painted() {
    if (this.watching) return [];
    const label = (number) => LABELS[number - 1]?.colour ?? "#000";
    if (this.job.value === "fill") return ["sample", "picture"].includes(this.seen) ? [{ strokes: this.hole, colour: () => HOLE }] : [];
    if (this.seen === "sample") return [{ strokes: this.guide.sample, colour: label }];
    return this.seen === "picture" && this.tool.value ? [{ strokes: this.guide.output, colour: label }] : [];
  }

  undo() {
    this.surface.pop();
    this.view.draw();
  }

  clear() {
    this.hole.length = this.guide.sample.length = this.guide.output.length = 0;
    this.view.draw();
  }

  // -- options

  optionsSection() {
    const change = () => this.changed();
    this.job = choice(Object.entries(JOBS), () => {
      this.settle();
      if (this.job.value === "fill") this.toFill();
      else this.changed();
    });
    this.method = choice([], () => {
      this.settle();
      this.changed();
    });
    this.width = number({ min: 1, max: 16384, step: 1, value: 256, onchange: change });
    this.height = number({ min: 1, max: 16384, step: 1, value: 256, onchange: change });
    this.seed = number({ min: 0, max: 4294967295, step: 1, value: 1, onchange: change });
    this.auto = make("input", { type: "checkbox", checked: true });
    this.makeButton = make("button", { type: "submit", class: "first" }, "Make it");
    const another = make("button", { type: "button", onclick: () => this.another() }, "Another seed");
    const reset = make("button", { type: "button", onclick: () => this.reset() }, "All options as by default");
    this.size = make("div", { class: "bar" }, labelled("Result width", this.width), labelled("Result height", this.height));
    this.methodField = labelled("Method", this.method);
    this.controls = make("div");
    const form = make(
      "form",
      {
        onsubmit: (event) => {
          event.preventDefault();
          this.make();
        },
      },
      labelled("What is made", this.job),
      this.methodField,
      this.size,
      make("div", { class: "bar" }, labelled("Seed", this.seed), another),
      labelled("Make it at every change", this.auto),
      this.makeButton,
      this.controls,
      reset,
    );
    return make("section", { "aria-label": "Options", class: "options" }, make("h2", {}, "Options"), form);
  }

  get table() {
    return this.job.value === "synth" ? this.method.value : this.job.value;
  }

  /** Show what goes with the job and the method. */
  settle() {
    this.methodField.hidden = this.size.hidden = this.job.value !== "synth";
    this.makeButton.textContent = BUTTONS[this.job.value];
    const options = this.options?.[this.table];
    if (options) this.controls.replaceChildren(options.element);
    this.view?.draw();
  }

  toFill() {
    this.tool.value = "hole";
    this.root.querySelector(".paint").open = true;
    if (this.shown === null && !this.running) this.look("sample");
    this.view.draw();
  }

  reset() {
    this.options[this.table].values = {};
    this.changed();
  }

  another() {
    this.seed.value = Math.floor(Math.random() * 2 ** 32);
    this.make();
  }

  changed() {
    clearTimeout(this.waiting);
    if (this.auto.checked && this.picture && this.job.value !== "fill") this.waiting = setTimeout(() => this.make(), 60);
  }

  make() {
    if (!this.picture) {
      this.tell("There is no picture yet; drop one, or choose a file.");
      return;
    }
    const job = this.job.value;
    const [width, height, seed] = [this.width, this.height, this.seed].map((input) => Number(input.value));
    const message = { kind: "make", job, method: this.method.value, width, height, seed, options: this.options[this.table].values };
    if (job !== "fill") message.part = this.part;
    if (job === "synth" && this.guide.output.length) message.guide = this.guide;
    if (job === "fill") {
      message.hole = this.hole;
      message.of = this.seen === "sample" ? null : this.shown;
    }
    this.last = message;
    this.send(message);
  }

  /** Show the settings that a result was made with. */
  restore(asked) {
    this.job.value = asked.job;
    if (asked.job === "synth") {
      this.method.value = asked.method;
      [this.width.value, this.height.value] = [asked.width, asked.height];
    }
    this.seed.value = asked.seed;
    this.options[this.table].values = asked.options;
    if (asked.job !== "fill") this.setPart(asked.part ?? null, false);
    if (asked.guide) this.guide = structuredClone(asked.guide);
    this.settle();
  }

  // -- what is said

  on_hello(message) {
    this.bytes = message.bytes;
    this.device.textContent = message.device;
    if (!this.options) {
      this.options = Object.fromEntries(Object.entries(message.controls).map(([name, controls]) => [name, new Options(controls, () => this.changed())]));
      this.method.replaceChildren(...Object.entries(message.methods).map(([value, text]) => make("option", { value }, text)));
      const example = (name) => make("button", { type: "button", onclick: () => this.example(name) }, name);
      this.examples.replaceChildren("or try ", ...message.examples.map(example));
      this.settle();
    }
    this.say("Ready.");
    this.strip.replaceChildren(this.currentItem);
    this.results.clear();
    this.running = this.stopped = false;
    this.shown = null;
    this.showRunning();
    this.view.ask();
    if (!message.fresh || !this.given) return;
    this.again = this.last?.job === "fill" ? null : this.last; // the server is another: it is given all anew
    if (this.given.bytes) this.send({ kind: "open", name: this.given.name }, [this.given.bytes]);
    else this.send({ kind: "example", name: this.given.name });
  }

  example(name) {
    this.given = { name };
    this.send({ kind: "example", name });
  }

  on_error({ text }) {
    this.tell(text);
  }

  connected(state, reason) {
    this.root.classList.toggle("lost", state === "lost");
    if (state === "open") {
      this.alert.hidden = true;
      this.send({ kind: "hello" });
      return;
    }
    this.running = false;
    this.showRunning();
    this.tell(`${reason ? `${reason}.` : "The connection to simdtex is lost."} The page tries again, and goes on when it is back.`);
    this.say("Not connected.");
  }

  say(text) {
    this.status.textContent = text;
  }

  tell(text) {
    this.alert.textContent = text;
    this.alert.hidden = false;
  }

  close() {
    document.removeEventListener("paste", this.paste);
    this.view.close();
    this.connection.close();
  }
}

export default {
  render({ model, el }) {
    const page = new Page(el, new Kernel(model));
    return () => page.close();
  },
};

const place = document.getElementById("simdtex-live");
if (place) {
  const address = new URL("socket", document.baseURI);
  address.protocol = address.protocol.replace("http", "ws");
  window.page = new Page(place, new Socket(address.href));
}

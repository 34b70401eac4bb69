// SPDX-License-Identifier: BSD-3-Clause
// The live page of simdtex: in a browser beside `simdtex live`, and in a notebook as the widget simdtex.Live.
// simdtex does all arithmetic on textures; the page shows frames and sends messages (docs/live.rst lists them).

const HOLE = "#ff1e9b";
const LAYERS = {
  labels: "Labels over the picture",
  picture: "Picture",
  sample: "Sample",
  arrangement: "Arrangement (source map)",
  use: "Use of the sample",
  temperature: "Temperature",
};
const JOBS = {
  synth: ["More of the texture", "Make the texture"],
  extend: ["A seamless picture", "Make it seamless"],
  fill: ["A filled hole", "Fill the hole"],
  classify: ["A classification by texture", "Classify the picture"],
}; // what the page calls them, and their button
const PICTURE_LAYERS = ["sample", "labels"]; // which show the picture itself
const SIDES = ["left", "top", "width", "height"];
const MAX_PIXELS = 2 ** 22; // of a frame
const PIECE = 2 ** 20; // bytes of a file that are sent at a time
const CONTROLS = ["button", "input", "select", "summary"];
const LEGENDS = {
  arrangement: "Each place of the sample has a colour of its own. An area without edges was copied whole.",
  use: "Black: never taken. Yellow: taken most often.",
  temperature: "Black: settled. Yellow: still to be decided. At the end of a run all is black.",
};

// -- connections --------------------------------------------------------------------------------------------------

/** A WebSocket to `simdtex live`, which is opened again when it is lost. */
class Socket {
  get key() {
    return sessionStorage.getItem("simdtex-session");
  }

  constructor(address) {
    this.address = address;
    this.wait = 250;
    this.onmessage = this.onstate = () => {};
  }

  open() {
    this.socket = new WebSocket(`${this.address}${this.key ? `?session=${this.key}` : ""}`);
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
    this.socket.onmessage = ({ data }) => {
      if (typeof data === "string") [this.message, this.buffers] = [JSON.parse(data), []];
      else this.buffers.push(new Uint8Array(data));
      if (this.buffers.length < this.message.buffers) return;
      if (this.message.kind === "hello") sessionStorage.setItem("simdtex-session", this.message.session);
      this.onmessage(this.message, this.buffers);
    };
  }

  send(message, buffers = []) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ ...message, buffers: buffers.map((buffer) => buffer.length) }));
    for (const buffer of buffers)
      for (let begin = 0; begin < buffer.length; begin += PIECE) this.socket.send(buffer.subarray(begin, begin + PIECE));
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
    this.received = (message, buffers) =>
      this.onmessage(message, (buffers ?? []).map((one) => new Uint8Array(one.buffer, one.byteOffset, one.byteLength)));
  }

  open() {
    this.model.on("msg:custom", this.received);
    this.onstate("open", "");
  }

  send(message, buffers = []) {
    this.model.send(message, undefined, buffers);
  }

  close() {
    this.model.off("msg:custom", this.received);
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
  // JupyterLab asks the element with the focus alone whether keys are its own
  if (CONTROLS.includes(tag) || "tabindex" in attributes) element.dataset.lmSuppressShortcuts = "true";
  return element;
}

/** A control and its label. */
function labelled(text, control, hint = "") {
  control.id ||= `simdtex-${++count}`;
  const field = make("div", { class: "field" }, make("label", { for: control.id }, text), control);
  if (hint) {
    field.append(make("small", { id: `${control.id}-hint` }, hint));
    control.setAttribute("aria-describedby", `${control.id}-hint`);
  }
  return field;
}

const button = (text, onclick, attributes = {}) => make("button", { type: "button", onclick, ...attributes }, text);
const number = (attributes) => make("input", { type: "number", step: 1, ...attributes });
const checkbox = (attributes) => make("input", { type: "checkbox", ...attributes });
const bar = (...children) => make("div", { class: "bar" }, ...children);
const choices = (pairs) => pairs.map(([value, text]) => make("option", { value }, text));
const choice = (pairs, onchange) => make("select", { onchange }, ...choices(pairs));
const made = (layers) => layers.find((name) => name !== "sample") ?? "sample";
const stem = (name) => name.replace(/\.[^.]*$/, "").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 40); // as simdtex names a map
const sentence = (text) => `${text[0].toUpperCase()}${text.slice(1)}.`;
const clamp = (value, least, most) => Math.max(least, Math.min(most, value));

/** RGBA bytes as something that a canvas draws. */
function bitmap(bytes, width, height) {
  const canvas = make("canvas", { width, height });
  const data = new ImageData(new Uint8ClampedArray(bytes.buffer, bytes.byteOffset, 4 * width * height), width, height);
  canvas.getContext("2d").putImageData(data, 0, 0);
  return canvas;
}

/** Follow a pointer that is pressed until it is released. */
function drag(element, event, move, end) {
  element.setPointerCapture(event.pointerId);
  const following = new AbortController();
  const stop = () => {
    following.abort();
    end();
  };
  const { signal } = following;
  element.addEventListener("pointermove", move, { signal });
  for (const kind of ["pointerup", "pointercancel"]) element.addEventListener(kind, stop, { signal });
}

// -- options ------------------------------------------------------------------------------------------------------

/** The controls of a method, made from the options' declarations. */
class Options {
  constructor(controls, onchange) {
    this.controls = controls;
    this.fields = new Map();
    const groups = new Map();
    for (const control of controls) {
      if (!groups.has(control.group)) {
        groups.set(control.group, make("details", {}, make("summary", {}, control.group)));
      }
      groups.get(control.group).append(this.field(control, onchange));
    }
    this.element = make("div", {}, ...groups.values());
  }

  field(control, onchange) {
    const { name, label, hint } = control;
    if (control.kind === "words" || control.kind === "switch") {
      const input = control.kind === "words" ? choice(control.valid, onchange) : checkbox({ onchange });
      const property = control.kind === "words" ? "value" : "checked";
      this.fields.set(name, { get: () => input[property], set: (value) => (input[property] = value ?? false) });
      this.fields.get(name).set(control.default);
      return labelled(label, input, hint);
    }
    const [least, most, step] = control.span;
    const input = number({ step: "any", min: control.least, placeholder: control.empty || null, onchange });
    const slider = make("input", { type: "range", min: least, max: most, step, "aria-label": `${label}, slider` });
    const note = make("small", { class: "beyond", role: "status" });
    const follow = () => {
      slider.value = input.value === "" ? (control.usual ?? least) : input.value;
      slider.classList.toggle("automatic", input.value === "");
      const beyond = Number(input.value) > most;
      note.textContent = beyond ? `More than ${most}: a run can take many times as long, or need too much memory.` : "";
    };
    slider.addEventListener("input", () => {
      input.value = slider.value;
      follow();
    });
    slider.addEventListener("change", onchange);
    input.addEventListener("input", follow);
    const get = () => (input.value === "" ? null : Number(input.value));
    const set = (value) => {
      input.value = value ?? "";
      follow();
    };
    this.fields.set(name, { get, set });
    set(control.default);
    const field = labelled(label, input, hint);
    input.after(slider, note);
    return field;
  }

  /** The options that differ from their defaults. */
  get values() {
    const values = this.controls.map(({ name, default: usual }) => [name, this.fields.get(name).get() ?? usual, usual]);
    return Object.fromEntries(values.filter(([, value, usual]) => value !== usual));
  }

  set values(given) {
    for (const control of this.controls) this.fields.get(control.name).set(given[control.name] ?? control.default);
  }
}

// -- the view -----------------------------------------------------------------------------------------------------

/** A window of a layer, at whole pixels: simdtex sends what the window shows and no more, so memory is bounded. */
class View {
  constructor(page) {
    this.page = page;
    this.left = this.top = 0;
    this.scale = 1; // above 0 pixels of the screen for each of the layer, below 0 the other way round
    this.fitted = true;
    this.rows = this.cols = 0;
    this.frame = null;
    this.cursor = null;
    this.canvas = make("canvas", { class: "view", tabindex: 0, role: "img", "aria-label": "There is no result yet." });
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
    this.scale = clamp(scale, -64, 64);
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

  /** Ask for the window, soon. */
  moved() {
    this.draw();
    clearTimeout(this.asking);
    this.asking = setTimeout(() => this.ask(), 15);
  }

  ask() {
    const { step } = this;
    const across = this.canvas.width / this.unit / step;
    const down = this.canvas.height / this.unit / step;
    const width = clamp(Math.ceil(across) + 1, 1, 4096);
    const height = clamp(Math.ceil(down) + 1, 1, Math.floor(MAX_PIXELS / width));
    const { layer, tiled } = this.page;
    this.page.send({ kind: "view", layer, left: this.left, top: this.top, width, height, step, tiled });
    this.page.zoomOutput.textContent = this.scale > 0 ? `${100 * this.scale} %` : `1 : ${-this.scale}`;
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
    this.canvas.style.touchAction = this.page.brush || !this.fitted ? "none" : "auto"; // else a finger scrolls the page
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
    for (const { strokes, colour } of this.page.visibleStrokes()) this.strokes(context, strokes, colour);
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
    const { brush } = this.page;
    if (event.pointerType === "touch" && !brush && this.fitted) return;
    let [x, y] = this.place(event);
    const point = () => [this.left + x / this.unit, this.top + y / this.unit].map((one) => Math.round(10 * (one - 0.5)) / 10);
    const move = (now) => {
      const [toX, toY] = this.place(now);
      if (brush) {
        [x, y] = [toX, toY];
        brush.add(point());
        this.draw();
        return;
      }
      const [cols, rows] = [(x - toX) / this.unit, (y - toY) / this.unit].map(Math.round);
      if (!cols && !rows) return;
      [x, y] = [x - cols * this.unit, y - rows * this.unit];
      this.pan(cols, rows);
    };
    brush?.begin(point());
    drag(this.canvas, event, move, () => brush?.end());
    this.draw();
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(event.deltaY < 0 ? 1 : -1, ...this.place(event));
  }

  key(event) {
    const directions = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const { brush } = this.page;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in directions) {
      const [x, y] = directions[event.key];
      if (brush) {
        const by = Math.max(1, Math.round(brush.width / 4)) * (event.shiftKey ? 4 : 1);
        const [col, row] = this.cursor ?? [this.cols / 2, this.rows / 2];
        this.cursor = [clamp(col + x * by, 0, this.cols - 1), clamp(row + y * by, 0, this.rows - 1)];
        if (this.down) brush.add([...this.cursor]);
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
    event.stopPropagation(); // a notebook has its own meaning for keys
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
    this.shown = null; // the number of the selected result
    this.picture = null;
    this.given = this.pending = null; // the file and its maps, to give them again to a server that was started anew
    this.session = connection.key;
    this.guide = { sample: [], output: [] };
    this.hole = [];
    this.part = null; // the region of the picture that is the sample
    this.layer = "picture"; // that is asked for; the frame's own is `seen`
    this.tiled = false;
    this.running = this.paused = false;
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
    const side = make("div", { class: "side" }, this.sampleSection(), this.optionsSection());
    this.columns = make("div", { class: "columns", hidden: true }, this.resultSection(), side);
    const header = make("header", {}, make("h1", {}, "simdtex live"), this.device, this.status);
    this.root = make("main", { class: "simdtex" }, header, this.alert, this.startSection(), this.columns);
    root.replaceChildren(this.root);
    this.root.addEventListener("dragover", (event) => event.preventDefault());
    this.root.addEventListener("drop", (event) => {
      event.preventDefault();
      this.open(event.dataTransfer.files[0], event.target.closest?.(".maps") ? "map" : "open");
    });
    this.paste = (event) => this.open(event.clipboardData?.files[0], "open");
    (root.id === "simdtex-live" ? document : this.root).addEventListener("paste", this.paste);
  }

  // -- sample

  /** What the page begins with. */
  startSection() {
    this.examples = make("div", { class: "examples" });
    this.start = make(
      "section",
      { "aria-label": "Start", class: "start" },
      make("h2", {}, "Drop a picture of a texture here"),
      make("p", {}, "or paste one, or choose a file:"),
      this.fileInput("A picture", "open"),
      make("p", {}, "or try an example:"),
      this.examples,
    );
    return this.start;
  }

  sampleSection() {
    this.preview = make("canvas", { class: "preview", role: "img", "aria-label": "There is no picture yet." });
    this.preview.addEventListener("pointerdown", (event) => this.drawPart(event));
    this.partFields = SIDES.map(() => number({ min: 0, onchange: () => this.typePart() }));
    this.partSet = make(
      "fieldset",
      { class: "part" },
      make("legend", {}, "Pixels"),
      ...this.partFields.map((input, index) => labelled(SIDES[index][0].toUpperCase() + SIDES[index].slice(1), input)),
      button("Whole picture", () => this.setPart(null)),
    );
    this.finger = button("Choose a part with a finger", () => this.chooseByFinger(!this.choosing), { class: "finger" });
    const typed = make("details", {}, make("summary", {}, "The part that is the sample"), this.finger, this.partSet);
    this.mapList = make("ul");
    this.maps = make(
      "details",
      { class: "maps" },
      make("summary", {}, "Further maps of the material"),
      make("p", {}, "Normal, height, roughness: each is arranged as the picture is."),
      this.fileInput("A further map", "map"),
      this.mapList,
    );
    this.named = make("p", { class: "named" });
    const parts = [make("h2", {}, "Sample"), this.named, this.fileInput("Another picture", "open"), this.preview, typed];
    return make("section", { "aria-label": "Sample", class: "sample" }, ...parts, this.maps);
  }

  fileInput(label, kind) {
    const input = make("input", { type: "file", accept: "image/*,.tif,.tiff,.npy", "aria-label": label });
    input.addEventListener("change", () => {
      this.open(input.files[0], kind);
      input.value = "";
    });
    return input;
  }

  async open(file, kind) {
    if (!file) return;
    if (this.bytes && file.size > this.bytes) {
      this.warn(`The file has ${file.size} bytes and at most ${this.bytes} are taken; give a smaller one.`);
      return;
    }
    const bytes = new Uint8Array(await file.arrayBuffer());
    const name = file.name || "pasted.png";
    if (kind === "open") this.pending = { name, bytes, maps: new Map() };
    else this.given?.maps.set(stem(name), { name, bytes });
    this.send({ kind, name }, [bytes]);
  }

  on_picture(message, [bytes]) {
    const before = this.picture;
    const same = before && ["name", "width", "height"].every((key) => before[key] === message[key]);
    this.picture = message;
    this.small = bitmap(bytes, ...message.preview);
    [this.preview.width, this.preview.height] = message.preview;
    this.preview.setAttribute("aria-label", `${message.name}, ${message.width} by ${message.height} pixels. Drag over it to choose the part that is the sample.`);
    const more = message.more ? ". The file has further frames or pages; this is the first." : "";
    this.named.textContent = `${message.name}, ${message.width} × ${message.height}, ${message.values}${more}`;
    this.start.hidden = true;
    this.columns.hidden = false;
    this.listMaps(message.maps);
    this.setPart(same && !message.new ? this.part : message.part, false);
    if (!message.new) {
      if (message.settings && !before) this.restore(message.settings); // else the page has its own, perhaps later ones
      return;
    }
    if (this.pending) this.given = { ...this.pending, label: message.name };
    this.pending = null;
    if (this.refused) for (const options of Object.values(this.options)) options.values = {};
    this.refused = false;
    this.downloads.hidden = true;
    this.doing.textContent = "";
    this.guide = { sample: [], output: [] };
    this.hole = [];
    this.mark(this.shown, false);
    this.shown = null;
    if (this.again) this.restore(this.again);
    else {
      [this.width.value, this.height.value] = message.size;
    }
    this.again = null;
    this.showJob();
    if (this.job.value !== "fill") this.make();
    if (["fill", "classify"].includes(this.job.value)) this.showLayer("sample");
  }

  /** The part, also where it is the whole picture. */
  get wholePart() {
    return this.part ?? [0, 0, this.picture.width, this.picture.height];
  }

  setPart(part, run = true) {
    const { width, height, preview } = this.picture;
    this.part = part && part[2] === width && part[3] === height ? null : part;
    this.partFields.forEach((input, index) => (input.value = this.wholePart[index]));
    const context = this.preview.getContext("2d");
    context.drawImage(this.small, 0, 0);
    if (this.part) {
      const scale = preview[0] / width;
      const [x, y, w, h] = this.part.map((one) => one * scale);
      context.fillStyle = "#0009";
      context.fillRect(0, 0, ...preview);
      context.drawImage(this.small, x, y, w, h, x, y, w, h);
    }
    if (run) this.changed();
  }

  typePart() {
    const { width, height } = this.picture;
    const [x, y, w, h] = this.partFields.map((input) => Math.round(Number(input.value)));
    const [across, down] = [clamp(w, Math.min(8, width), width), clamp(h, Math.min(8, height), height)];
    this.setPart([clamp(x, 0, width - across), clamp(y, 0, height - down), across, down]);
  }

  drawPart(event) {
    if (!this.picture || event.button !== 0 || (event.pointerType === "touch" && !this.choosing)) return;
    const box = this.preview.getBoundingClientRect();
    const place = (now) => [
      Math.round(clamp((now.clientX - box.left) / box.width, 0, 1) * this.picture.width),
      Math.round(clamp((now.clientY - box.top) / box.height, 0, 1) * this.picture.height),
    ];
    const [x, y] = place(event);
    const before = this.part;
    const move = (now) => {
      const [toX, toY] = place(now);
      const part = [Math.min(x, toX), Math.min(y, toY), Math.abs(toX - x), Math.abs(toY - y)];
      if (part[2] >= 8 && part[3] >= 8) this.setPart(part, false);
    };
    drag(this.preview, event, move, () => {
      this.chooseByFinger(false);
      if (this.part !== before) this.changed();
    });
  }

  /** Let a finger on the preview choose the part, or scroll the page. */
  chooseByFinger(choosing) {
    this.choosing = choosing;
    this.preview.style.touchAction = choosing ? "none" : "auto";
    this.finger.setAttribute("aria-pressed", `${choosing}`);
  }

  on_maps({ names }) {
    this.listMaps(names);
    if (names.length && (this.shown !== null || this.running)) this.make();
  }

  listMaps(names) {
    const unmap = (name) => {
      this.given?.maps.delete(name);
      this.send({ kind: "unmap", name });
    };
    const remove = (name) => button("×", () => unmap(name), { "aria-label": `Remove ${name}` });
    this.mapList.replaceChildren(...names.map((name) => make("li", {}, `${name} `, remove(name))));
  }

  // -- result

  resultSection() {
    this.view = new View(this);
    this.layerChoice = choice(Object.entries(LAYERS), () => this.showLayer(this.layerChoice.value));
    this.tiling = checkbox({ onchange: () => this.tile() });
    this.zoomOutput = make("output", { "aria-label": "Zoom" }, "100 %");
    const zoom = [
      button("−", () => this.view.zoom(-1), { "aria-label": "Zoom out" }),
      this.zoomOutput,
      button("+", () => this.view.zoom(1), { "aria-label": "Zoom in" }),
      button("Fit", () => this.view.fit()),
    ];
    const shown = bar(labelled("Layer", this.layerChoice), labelled("Tiled 3 × 3", this.tiling), bar(...zoom));
    this.scale = make("span", { class: "scale", "aria-hidden": "true" });
    this.meaning = make("span");
    this.legend = make("p", { class: "legend", hidden: true }, this.scale, this.meaning);
    this.classes = make("ul", { class: "classes", "aria-label": "Classes", hidden: true });
    this.hint = make("p", { role: "status", class: "hint" });
    this.progress = make("progress", { max: 1, value: 0, "aria-label": "Progress" });
    this.doing = make("p", { class: "doing" });
    this.pausing = button("Pause", () => this.pause(), { disabled: true });
    this.cancelling = button("Cancel", () => this.send({ kind: "cancel" }), { disabled: true });
    this.current = button("Current run", () => this.send({ kind: "select", result: null }));
    this.currentItem = make("li", { class: "current", hidden: true }, this.current);
    this.strip = make("ol", { class: "strip", "aria-label": "Results" }, this.currentItem);
    this.files = bar();
    this.archive = make("p");
    this.command = make("pre", { tabindex: 0, "aria-label": "Command line" });
    this.downloads = make(
      "section",
      { "aria-label": "Download", hidden: true },
      make("h3", {}, "Download"),
      this.files,
      this.archive,
      this.command,
      button("Copy the command line", () => this.copy(this.command.textContent)),
    );
    return make(
      "section",
      { "aria-label": "Result", class: "result" },
      make("h2", {}, "Result"),
      shown,
      this.view.canvas,
      this.legend,
      this.hint,
      this.classes,
      bar(this.pausing, this.cancelling, this.progress),
      this.doing,
      this.paintSet(),
      this.strip,
      this.downloads,
    );
  }

  showLayer(layer) {
    this.layer = this.layerChoice.value = layer;
    this.view.moved();
    this.view.ask();
  }

  tile() {
    this.tiled = this.tiling.checked;
    this.view.fit();
  }

  on_frame(message, [bytes]) {
    this.send({ kind: "shown" });
    this.seen = message.layer;
    this.meaning.textContent = LEGENDS[message.layer] ?? "";
    this.legend.hidden = !LEGENDS[message.layer];
    this.scale.hidden = message.layer === "arrangement";
    this.view.show(message, bytes);
    if (message.of === "run") this.frames += 1;
  }

  on_progress({ fraction, doing }) {
    this.progress.value = fraction;
    if (this.watching) this.doing.textContent = doing;
  }

  /** Offer these layers. */
  offer(layers) {
    const text = (name) => LAYERS[name] ?? name.replace(/^map /, "Map: ");
    this.layerChoice.replaceChildren(...choices(layers.map((name) => [name, text(name)])));
    if (!layers.includes(this.layer)) this.showLayer(made(layers));
    this.layerChoice.value = this.layer;
  }

  on_begun(message) {
    this.runLayers = message.layers;
    this.frames = 0;
    this.progress.value = 0;
    this.alert.hidden = true;
    this.refused = false;
    this.hint.textContent = this.doing.textContent = "";
    this.setRunning(true);
    this.select(null);
    this.say(message.from === null ? "Running." : `Continuing after level ${message.from}.`);
    if (this.layer === "sample") this.showLayer(made(message.layers));
  }

  on_hint({ text }) {
    this.alert.hidden = true;
    this.hint.textContent = sentence(text);
  }

  on_ended() {
    this.setRunning(false);
    this.say("Cancelled.");
  }

  on_result(message, [bytes]) {
    const { result, width, height, settings, picture } = message;
    this.setRunning(false);
    this.progress.value = 1;
    this.results.set(result, message);
    const dropped = message.dropped.filter((number) => this.results.has(number));
    for (const number of dropped) {
      this.results.get(number).item.remove();
      this.results.delete(number);
    }
    const small = bitmap(bytes, ...message.thumbnail);
    small.setAttribute("aria-hidden", "true");
    message.button = button(small, () => this.send({ kind: "select", result }), { title: `From ${picture}` });
    message.button.append(make("span", {}, `Result ${result}, ${width} × ${height}, seed ${settings.seed}`));
    message.item = make("li", {}, message.button);
    this.currentItem.before(message.item);
    this.strip.scrollLeft = this.strip.scrollWidth;
    const gone = dropped.length ? ` Result ${dropped.join(", ")} is no longer kept, to save memory.` : "";
    this.say(`Result ${result} is ready: ${this.summary(message)}${gone}`);
    if (this.results.size === 1 && this.columns.clientWidth > 1000) this.controls.querySelector("details").open = true;
  }

  summary({ width, height, seconds, device, settings, note }) {
    return `${width} × ${height} in ${seconds.toFixed(2)} s on ${device}, seed ${settings.seed}${note && `. ${note}`}`.replace(/\.?$/, ".");
  }

  on_selected({ result, settings }) {
    this.select(result);
    if (settings) this.restore(settings);
    const found = this.results.get(result);
    if (!found) {
      this.doing.textContent = "";
      this.view.canvas.setAttribute("aria-label", "The run, or the sample.");
      return;
    }
    if (!settings && found.settings.job === "fill") this.hole = [];
    this.doing.textContent = this.summary(found);
    this.view.canvas.setAttribute("aria-label", `Result ${result}: ${this.summary(found)} Arrow keys move, plus and minus zoom, 0 fits.`);
    this.command.textContent = found.command;
    const download = (name) => button(name, () => this.send({ kind: "download", result, name }), { "data-file": name });
    this.files.replaceChildren(...found.files.map(download));
    this.archive.textContent = `This line makes the same bytes from the files in ${found.files.at(-1)}:`;
  }

  /** Mark a result, or the present run, as the one that is shown. */
  select(result) {
    this.mark(this.shown, false);
    this.shown = result;
    this.mark(result, true);
    const found = this.results.get(result);
    this.downloads.hidden = !found;
    this.offer(found?.layers ?? (this.running ? this.runLayers : ["sample"]));
    this.showClasses();
  }

  /** Show the classes of a result and their shares; before there is one, the classes that are painted. */
  showClasses() {
    const painted = [...new Set(this.guide.sample.map(({ label }) => label))].filter(Boolean).sort();
    const found = this.results.get(this.shown)?.shares ?? [];
    const classes = found.length || this.job.value !== "classify" ? found : painted.map((label) => [label, null]);
    const item = ([label, share]) => {
      const swatch = make("span", { class: "swatch", "aria-hidden": "true" });
      swatch.style.background = this.colours[label];
      const name = label ? `Label ${label}` : "Unknown";
      return make("li", {}, swatch, share === null ? name : `${name}: ${(100 * share).toFixed(1)} %`);
    };
    this.classes.replaceChildren(...classes.map(item));
    this.classes.hidden = !classes.length;
  }

  mark(result, current) {
    const marked = result === null ? this.current : this.results.get(result)?.button;
    if (current) marked?.setAttribute("aria-current", "true");
    else marked?.removeAttribute("aria-current");
  }

  on_file({ name }, [bytes]) {
    const address = URL.createObjectURL(new Blob([bytes]));
    make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60000);
    this.say(`${name} is downloaded.`);
  }

  async copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      this.say("Copied.");
    } catch {
      this.warn("The browser does not allow copying here; select the text instead.");
    }
  }

  pause() {
    this.send({ kind: this.paused ? "resume" : "pause" });
    this.setRunning(true, !this.paused);
    this.say(this.paused ? "Paused." : "Running.");
  }

  setRunning(running, paused = false) {
    [this.running, this.paused] = [running, paused];
    this.pausing.disabled = this.cancelling.disabled = !running;
    this.pausing.textContent = paused ? "Resume" : "Pause";
    this.currentItem.hidden = !running;
  }

  // -- painting

  paintSet() {
    this.tool = choice([], () => this.chooseTool());
    this.brushWidth = number({ min: 1, max: 1024, value: 16 });
    const hint =
      "Labels are a guide: what has a label on the sample goes where the result has the same. For a classification, paint each texture of the picture with a label of its own. With the keyboard, arrow keys move the brush, and the space bar starts and ends a stroke.";
    return make(
      "details",
      { class: "paint" },
      make("summary", {}, "Paint a hole, a guide or classes"),
      bar(
        labelled("Paint", this.tool),
        labelled("Brush width, pixels", this.brushWidth),
        button("Undo", () => this.undo()),
        button("Clear all", () => this.clear()),
      ),
      make("p", {}, hint),
    );
  }

  chooseTool() {
    if (this.tool.value === "hole") this.job.value = "fill";
    this.showJob();
  }

  /** The strokes that the tool adds to. */
  get surface() {
    if (this.tool.value === "hole" || (this.tool.value === "0" && this.job.value === "fill")) return this.hole;
    return this.labelStrokes;
  }

  get labelStrokes() {
    return this.seen === "sample" || this.job.value === "classify" ? this.guide.sample : this.guide.output;
  }

  /** Whether the run is shown, which cannot be painted on. */
  get watching() {
    return this.running && this.shown === null;
  }

  get paintable() {
    if (this.job.value === "classify") return PICTURE_LAYERS.includes(this.seen); // which stays as it is during the run
    return !this.watching && ["sample", "picture"].includes(this.seen);
  }

  get brush() {
    if (!this.tool.value || !this.paintable) return null;
    const width = Math.max(1, Number(this.brushWidth.value) || 16);
    const label = this.tool.value === "hole" ? 1 : Number(this.tool.value);
    const { surface } = this;
    return {
      width,
      begin: (point) => surface.push({ label, width, points: [point] }),
      add: (point) => surface.at(-1)?.points.push(point),
      end: () => surface !== this.hole && this.painted(),
    };
  }

  /** Run again with labels that have changed. */
  painted() {
    this.showClasses();
    if (this.job.value === "classify" || (this.guide.sample.length && this.guide.output.length)) this.changed();
  }

  visibleStrokes() {
    if (!this.paintable) return [];
    if (this.job.value === "fill") return this.tool.value ? [{ strokes: this.hole, colour: () => HOLE }] : [];
    const colour = (label) => this.colours[label];
    return this.seen === "sample" || this.tool.value ? [{ strokes: this.labelStrokes, colour }] : [];
  }

  undo() {
    this.surface.pop();
    this.repainted();
  }

  clear() {
    this.hole.length = this.guide.sample.length = this.guide.output.length = 0;
    this.repainted();
  }

  repainted() {
    this.view.draw();
    if (this.job.value === "classify") this.painted();
  }

  // -- options

  optionsSection() {
    const onchange = () => this.changed();
    const jobs = Object.entries(JOBS).map(([name, [label]]) => [name, label]);
    this.job = choice(jobs, () => {
      this.showJob();
      if (this.job.value === "fill") this.startHole();
      else if (this.job.value === "classify") this.startClasses();
      else this.changed();
    });
    this.method = choice([], () => {
      this.showJob();
      this.changed();
    });
    this.width = number({ min: 1, max: 16384, value: 256, onchange });
    this.height = number({ min: 1, max: 16384, value: 256, onchange });
    this.seed = number({ min: 0, max: 4294967295, value: 1, onchange });
    this.auto = checkbox({ checked: true });
    this.makeButton = make("button", { type: "submit", class: "first" }, JOBS.synth[1]);
    this.size = bar(labelled("Result width", this.width), labelled("Result height", this.height));
    this.methodField = labelled("Method", this.method);
    this.controls = make("div");
    const onsubmit = (event) => {
      event.preventDefault();
      this.make();
    };
    const form = make(
      "form",
      { onsubmit },
      labelled("Make", this.job),
      this.methodField,
      this.size,
      bar(labelled("Seed", this.seed), button("New seed", () => this.newSeed())),
      labelled("Run at every change", this.auto),
      this.makeButton,
      this.controls,
      button("Reset the options", () => this.reset()),
    );
    return make("section", { "aria-label": "Options", class: "options" }, make("h2", {}, "Options"), form);
  }

  /** The controls of the method, or of a job that has its own. */
  get jobOptions() {
    return this.options[this.job.value === "synth" ? this.method.value : this.job.value];
  }

  /** Show the controls of the job and the method. */
  showJob() {
    this.methodField.hidden = this.size.hidden = this.job.value !== "synth";
    this.makeButton.textContent = JOBS[this.job.value][1];
    if (this.options) this.controls.replaceChildren(this.jobOptions.element);
    if (this.job.value !== "classify") this.hint.textContent = "";
    this.showClasses();
    this.view.draw();
  }

  startHole() {
    this.tool.value = "hole";
    this.root.querySelector(".paint").open = true;
    if (this.layer === "labels" || (this.shown === null && !this.running)) this.showLayer("sample");
    this.view.draw();
  }

  startClasses() {
    if (!(this.tool.value > 0)) this.tool.value = "1";
    this.root.querySelector(".paint").open = true;
    if (this.picture && this.layer !== "labels") this.showLayer("sample");
    this.painted();
  }

  reset() {
    this.jobOptions.values = {};
    this.changed();
  }

  newSeed() {
    this.seed.value = Math.floor(Math.random() * 2 ** 32);
    this.make();
  }

  changed() {
    clearTimeout(this.waiting);
    if (this.auto.checked && this.picture && this.job.value !== "fill") this.waiting = setTimeout(() => this.make(), 60);
  }

  make() {
    if (!this.picture) {
      this.warn("There is no picture yet; drop one, or choose a file.");
      return;
    }
    const job = this.job.value;
    const [width, height, seed] = [this.width, this.height, this.seed].map((input) => Number(input.value));
    const message = { kind: "make", job, method: this.method.value, width, height, seed, options: this.jobOptions.values };
    if (job === "fill") Object.assign(message, { hole: this.hole, of: PICTURE_LAYERS.includes(this.seen) ? null : this.shown });
    else if (job !== "classify") message.part = this.part;
    if (job === "classify" || (job === "synth" && this.guide.output.length)) message.guide = this.guide;
    this.last = structuredClone(message);
    this.send(message);
  }

  /** Show the settings of a result. */
  restore(settings) {
    this.job.value = settings.job;
    if (settings.job === "synth") {
      this.method.value = settings.method;
      [this.width.value, this.height.value] = [settings.width, settings.height];
    }
    this.seed.value = settings.seed;
    this.jobOptions.values = settings.options;
    this.setPart(settings.part ?? null, false);
    this.guide = structuredClone(settings.guide ?? { sample: [], output: [] });
    this.hole = structuredClone(settings.hole ?? []);
    if (settings.job === "fill") this.tool.value = ""; // the strokes would hide what they were filled with
    else if (this.tool.value === "hole") this.tool.value = "";
    this.showJob();
    if (this.hole.length) this.hint.textContent = "The hole is kept: choose Hole under Paint to see it.";
  }

  // -- the connection

  on_hello(message, buffers) {
    this.bytes = message.bytes;
    this.device.textContent = message.device;
    this.colours = message.colours.map((colour) => `rgb(${colour})`);
    if (!this.options) {
      const options = ([name, controls]) => [name, new Options(controls, () => this.changed())];
      this.options = Object.fromEntries(Object.entries(message.controls).map(options));
      const labels = this.colours.slice(1).map((_, index) => [`${index + 1}`, `Label ${index + 1}`]);
      this.tool.replaceChildren(...choices([["", "Nothing"], ["hole", "Hole"], ...labels, ["0", "Eraser"]]));
      this.method.replaceChildren(...choices(Object.entries(message.methods)));
      this.scale.style.background = `linear-gradient(to right, ${message.scale.map((colour) => `rgb(${colour})`)})`;
      const picture = (size, bytes) => {
        const small = bitmap(bytes, ...size);
        small.setAttribute("aria-hidden", "true");
        return small;
      };
      const shown = ([name, size], index) => {
        const found = button(name, () => this.example(name));
        found.prepend(picture(size, buffers[index]));
        return found;
      };
      this.examples.replaceChildren(...Object.entries(message.examples).map(shown));
      this.showJob();
    }
    this.say("Ready.");
    this.strip.replaceChildren(this.currentItem);
    this.results.clear();
    this.shown = null;
    this.setRunning(false);
    this.view.ask();
    const other = this.session && this.session !== message.session; // simdtex was started anew, or has forgotten the page
    this.session = message.session;
    if (!other || !message.fresh) return;
    if (this.given && this.given.label === this.picture?.name) this.giveAgain();
    else {
      this.picture = null;
      this.start.hidden = false;
      this.columns.hidden = true;
      this.warn("The picture and the results of this page are no longer kept; give the picture again.");
    }
  }

  giveAgain() {
    this.again = this.last?.job === "fill" ? null : this.last;
    this.pending = this.given;
    if (this.given.bytes) this.send({ kind: "open", name: this.given.name }, [this.given.bytes]);
    else this.send({ kind: "example", name: this.given.name });
    for (const { name, bytes } of this.given.maps.values()) this.send({ kind: "map", name }, [bytes]);
  }

  example(name) {
    this.pending = { name, maps: new Map() };
    this.send({ kind: "example", name });
  }

  /** Say what is wrong; with a `job`, that could not be done. */
  on_error({ text, job }) {
    this.warn(text);
    if (!job) return;
    this.refused = true;
    this.say("Nothing was made.");
  }

  connected(state, reason) {
    this.root.classList.toggle("lost", state === "lost");
    if (state === "open") {
      this.alert.hidden = true;
      this.send({ kind: "hello" });
      return;
    }
    this.setRunning(false);
    this.warn(`${reason ? `${reason}.` : "The connection to simdtex is lost."} The page tries to connect again.`);
    this.say("Not connected.");
  }

  say(text) {
    this.status.textContent = text;
  }

  warn(text) {
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

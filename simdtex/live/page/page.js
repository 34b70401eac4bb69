// SPDX-License-Identifier: BSD-3-Clause

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
    this.awaited = new Map();
    connection.onmessage = (message, buffers) => {
      const handler = `on_${message.kind}`;
      (this[handler] ? this : this.inside)[handler]?.(message, buffers);
      this.awaited.get(message.kind)?.(message);
      this.awaited.delete(message.kind);
    };
    connection.onstate = (state, reason) => this.connected(state, reason);
    connection.open();
  }

  send(message, buffers) {
    this.connection.send(message, buffers);
  }

  /** Wait for the next message of a kind. */
  next(kind) {
    return new Promise((done) => this.awaited.set(kind, done));
  }

  build(root) {
    this.view = null;
    this.status = make("p", { role: "status", class: "status" }, "Connecting …");
    this.alert = make("p", { role: "alert", class: "alert", hidden: true });
    this.device = make("p", { class: "device" });
    const side = make("div", { class: "side" }, this.sampleSection(), this.optionsSection());
    this.columns = make("div", { class: "columns", hidden: true }, this.resultSection(), side);
    this.lecture = new Lecture(this);
    const lecture = button("Lecture: why this pixel?", (event) => this.lecture.start(event.currentTarget));
    const header = make("header", {}, make("h1", {}, "simdtex live"), this.device, lecture, this.status);
    this.root = make("main", { class: "simdtex", tabindex: -1 }, header, this.alert, this.startSection(), this.columns, this.lecture.element);
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
    this.demo = make("canvas", { class: "demo", width: 1, height: 1, role: "img", "aria-label": "A run: large shapes settle first." });
    this.start = make(
      "section",
      { "aria-label": "Start", class: "start" },
      this.demo,
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
    const input = make("input", { type: "file", accept: "image/*,.tif,.tiff,.npy,.json", "aria-label": label });
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
    if (kind === "open" && name.endsWith(".json")) {
      await this.restoreView(bytes);
      return;
    }
    if (kind === "open") this.give({ name, bytes, maps: new Map() });
    else this.giveMap({ name, bytes });
  }

  /** Give a picture, an example if it has no bytes, and its maps, which are kept in case the server is started anew. */
  give(given) {
    const { name, bytes, maps } = given;
    this.pending = given;
    if (bytes) this.send({ kind: "open", name }, [bytes]);
    else this.send({ kind: "example", name });
    for (const map of maps.values()) this.giveMap(map);
  }

  giveMap({ name, bytes }) {
    this.given?.maps.set(stem(name), { name, bytes });
    this.send({ kind: "map", name }, [bytes]);
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
    this.offerFiles(false);
    this.doing.textContent = "";
    this.guide = { sample: [], output: [] };
    this.hole = [];
    this.mark(this.shown, false);
    this.shown = null;
    this.say("Ready.");
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
    this.inside = new Inside(this);
    this.layerChoice = choice(Object.entries(LAYERS), () => this.showLayer(this.layerChoice.value));
    this.tiling = checkbox({
      onchange: () => {
        this.tiled = this.tiling.checked;
        this.view.fit();
      },
    });
    this.zoomOutput = make("output", { "aria-label": "Zoom" }, "100 %");
    const zoom = [
      button("−", () => this.view.zoom(-1), { "aria-label": "Zoom out" }),
      this.zoomOutput,
      button("+", () => this.view.zoom(1), { "aria-label": "Zoom in" }),
      button("Fit", () => this.view.fit()),
    ];
    this.latticeShown = checkbox({ onchange: () => this.view.draw() });
    this.fitting = button("", () => this.useFitting(), { hidden: true, class: "fitting" });
    this.latticeField = labelled("Lattice", this.latticeShown);
    const tiled = labelled("Tiled 3 × 3", this.tiling);
    const layer = labelled("Layer", this.layerChoice);
    const shown = bar(bar(...zoom), layer, tiled, this.latticeField, this.fitting); // what changes its width comes last
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
    this.downloads = make("section", { "aria-label": "Download" }, make("h3", {}, "Download"), this.files);
    const copying = button("Copy the command line", () => this.copy(this.command.textContent));
    this.recipe = make("section", { "aria-label": "The same bytes again" }, this.archive, this.command, copying);
    return make(
      "section",
      { "aria-label": "Result", class: "result" },
      make("h2", {}, "Result"),
      shown,
      make("div", { class: "stage" }, this.view.element, make("div", { class: "kept" }, this.strip, this.downloads)),
      this.legend,
      this.hint,
      this.classes,
      bar(this.pausing, this.cancelling, this.progress),
      this.doing,
      this.inside.element,
      this.paintSet(),
      this.recipe,
    );
  }

  /** Show or hide the files of a result; their place stays, so that nothing moves. */
  offerFiles(shown) {
    for (const one of [this.downloads, this.recipe]) one.style.visibility = shown ? "" : "hidden";
  }

  showLayer(layer) {
    this.layer = this.layerChoice.value = layer;
    this.view.moved();
    this.view.ask();
  }

  /** Show what the run began from while a key is held, then the layer again. */
  before(held) {
    if (held === Boolean(this.held)) return;
    const layer = held ? "sample" : this.held;
    this.held = held ? this.layer : null;
    this.showLayer(layer);
  }

  /** The lattice that is drawn over the result; null if none is. */
  get lattice() {
    return this.latticeShown.checked ? (this.results.get(this.shown)?.lattice ?? null) : null;
  }

  useFitting() {
    const [rows, cols] = this.results.get(this.shown).lattice.fitting;
    [this.width.value, this.height.value] = [cols, rows];
    this.make();
  }

  on_frame(message, [bytes]) {
    this.send({ kind: "shown" });
    if (message.pane) {
      this.view.show(message, bytes);
      return;
    }
    this.seen = message.layer;
    this.meaning.textContent = LEGENDS[message.layer] ?? "";
    this.legend.hidden = !LEGENDS[message.layer];
    this.scale.hidden = !["use", "temperature"].includes(message.layer);
    this.view.show(message, bytes);
    if (message.of === "run") this.frames += 1;
  }

  on_progress({ fraction, doing }) {
    this.progress.value = fraction;
    if (this.watching) this.doing.textContent = doing;
  }

  /** Offer the layers of what is shown. */
  offerLayers() {
    const found = this.results.get(this.shown);
    const layers = [...(found?.layers ?? (this.running ? this.runLayers : ["sample"]))];
    if (this.inside.at) layers.push("sets");
    const text = (name) => LAYERS[name] ?? name.replace(/^map /, "Map: ");
    this.layerChoice.replaceChildren(...choices(layers.map((name) => [name, text(name)])));
    if (!layers.includes(this.layer)) this.showLayer(made(layers));
    this.layerChoice.value = this.layer;
    this.fitting.disabled = !found;
    if (!found && this.running) return; // the controls stay where they are during a run
    this.latticeField.hidden = !found?.lattice;
    const [rows, cols] = found?.lattice?.fitting ?? [found?.height, found?.width];
    this.fitting.hidden = !found || found.settings.job !== "synth" || (rows === found.height && cols === found.width);
    this.fitting.textContent = `Use ${cols} × ${rows}, which fits`;
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
    message.button = button(bitmap(bytes, ...message.thumbnail), () => this.send({ kind: "select", result }), { title: `From ${picture}` });
    message.button.append(make("span", {}, `Result ${result}, ${width} × ${height}, seed ${settings.seed}`));
    message.item = make("li", {}, message.button);
    this.currentItem.before(message.item);
    this.strip.scrollTo(this.strip.scrollWidth, this.strip.scrollHeight);
    const gone = dropped.length ? ` Result ${dropped.join(", ")} is no longer kept, to save memory.` : "";
    this.say(`Result ${result} is ready${this.shown === null ? "" : `; result ${this.shown} is shown`}.${gone}`);
    if (this.results.size === 1 && this.columns.clientWidth > 1000) this.controls.querySelector("details").open = true;
  }

  on_selected({ result, settings }) {
    this.select(result);
    if (settings) this.restore(settings);
    const found = this.results.get(result);
    if (!found) {
      this.doing.textContent = "";
      this.view.canvas.setAttribute("aria-label", "The run, or the sample.");
      if (this.running) this.say(this.paused ? "Paused." : "Running.");
      return;
    }
    if (!this.status.textContent.startsWith(`Result ${result} is ready`)) this.say(`Result ${result} is shown.`);
    if (!settings && found.settings.job === "fill") this.hole = [];
    const { width, height, seconds, note } = found;
    const size = `${width} × ${height} in ${seconds.toFixed(2)} s, seed ${found.settings.seed}`;
    this.doing.textContent = (note ? `${size}. ${note}` : size).replace(/\.?$/, ".");
    this.view.canvas.setAttribute("aria-label", `Result ${result}: ${this.doing.textContent} Arrow keys move, plus and minus zoom, 0 fits.`);
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
    this.offerFiles(Boolean(found));
    this.inside.close();
    this.offerLayers();
    this.inside.look();
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

  /** Give everything that is shown as a file, which brings it back when it is dropped on the page. */
  saveView() {
    const numbers = [this.shown, this.inside.beside].filter((number) => number !== null);
    const runs = numbers.map((number) => this.results.get(number).settings);
    if (!this.given || runs.some(({ of }) => of)) {
      this.warn("Only a picture that was given to this page can be saved with its view; give it again first.");
      return;
    }
    const text = (bytes) => bytes && btoa(Array.from(bytes, (one) => String.fromCharCode(one)).join(""));
    const { name, bytes, maps } = this.given;
    const { left, top, unit } = this.view;
    const given = { name, bytes: text(bytes), maps: [...maps.values()].map((one) => ({ name: one.name, bytes: text(one.bytes) })) };
    const { at, sweeps, pixel } = this.inside;
    const moment = at && [...sweeps[at[0]].slice(0, 2), at[1]];
    const saved = { simdtex: "view", given, runs, moment, pixel, layer: this.layer, tiled: this.tiled, left, top, unit };
    this.on_file({ name: `${stem(name)}-view.json` }, [new TextEncoder().encode(JSON.stringify(saved))]);
  }

  /** Bring back what `saveView` has saved. */
  async restoreView(bytes) {
    let saved = {};
    try {
      saved = JSON.parse(new TextDecoder().decode(bytes));
    } catch {
      // the sentence below says it
    }
    if (saved.simdtex !== "view") {
      this.warn("This file is no view that the live page has saved.");
      return;
    }
    const read = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
    const { given, runs, moment } = saved;
    [this.again] = runs;
    this.give({ name: given.name, bytes: given.bytes && read(given.bytes), maps: new Map() });
    await this.next("picture");
    for (const { name, bytes: map } of given.maps) {
      this.giveMap({ name, bytes: read(map) });
      await this.next("maps");
    }
    const numbers = [];
    for (const settings of [...runs].reverse()) {
      this.restore(settings);
      this.last = structuredClone(settings);
      this.send({ ...settings, kind: "make" });
      numbers.unshift((await this.next("result")).result);
    }
    this.inside.element.open = true;
    await this.next("inside");
    if (numbers.length > 1) {
      this.inside.look(numbers[1]);
      await this.next("inside");
    }
    if (moment) {
      this.inside.seek(this.inside.sweeps.findIndex((one) => one[0] === moment[0] && one[1] === moment[1]), moment[2]);
      await this.next("moments");
    }
    this.tiling.checked = this.tiled = saved.tiled;
    Object.assign(this.view, { left: saved.left, top: saved.top, unit: saved.unit, fitted: false });
    this.showLayer(saved.layer);
    if (saved.pixel) this.inside.pick(...saved.pixel);
    this.say("The view is restored.");
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
    if (this.inside.open) return false; // a click explains a pixel
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
    const hollow = this.seen === "picture" && Boolean(this.results.get(this.shown)?.settings.guide); // else it is hidden
    return this.seen === "sample" || this.tool.value ? [{ strokes: this.labelStrokes, colour, hollow }] : [];
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
      const shown = ([name, size], index) => {
        const found = button(name, () => this.give({ name, maps: new Map() }));
        found.prepend(bitmap(buffers[index], ...size));
        return found;
      };
      this.examples.replaceChildren(...Object.entries(message.examples).map(shown));
      this.showJob();
    }
    this.say("Ready.");
    if (message.fresh) followLink(this);
    if (message.fresh) setTimeout(() => !this.start.hidden && this.send({ kind: "demo" }), 300); // any message ends its run
    this.strip.replaceChildren(this.currentItem);
    this.inside.close();
    this.results.clear();
    this.shown = null;
    this.setRunning(false);
    this.view.ask();
    const other = this.session && this.session !== message.session; // simdtex was started anew, or has forgotten the page
    this.session = message.session;
    if (!other || !message.fresh) return;
    if (this.given && this.given.label === this.picture?.name) {
      this.again = this.last?.job === "fill" ? null : this.last;
      this.give(this.given);
    } else {
      this.picture = null;
      this.start.hidden = false;
      this.columns.hidden = true;
      this.warn("The picture and the results of this page are no longer kept; give the picture again.");
    }
  }

  /** Play the pictures of a small run until there is a picture. */
  on_demo({ width, height }, pictures) {
    const shown = pictures.map((bytes) => bitmap(bytes, width, height));
    [this.demo.width, this.demo.height] = [width, height];
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    let number = still ? shown.length - 1 : 0;
    const next = () => {
      this.demo.getContext("2d").drawImage(shown[number], 0, 0);
      if (still || this.start.hidden) return;
      const last = number === shown.length - 1;
      number = last ? 0 : number + 1;
      setTimeout(next, last ? 2000 : 120);
    };
    next();
  }

  /** Say what is wrong; with a `job`, that could not be done. */
  on_error({ text, job }) {
    this.warn(sentence(text));
    this.inside.failed(sentence(text));
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
    this.say("Not connected.");
    if (state === "ended") {
      this.warn("The kernel was started anew, and this widget is no longer connected. Run its cell again.");
      for (const one of this.root.querySelectorAll("button, input, select")) one.disabled = true;
      return;
    }
    this.warn(`${reason ? `${reason}.` : "The connection to simdtex is lost."} The page tries to connect again.`);
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
    this.view.observer.disconnect();
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

const recorded = document.getElementById("simdtex-recorded");
if (recorded) {
  const page = new Page(recorded, new Recording(window.simdtexRecording));
  page.root.classList.add("recorded");
  page.next("selected").then(() => (page.inside.element.open = true));
}

// SPDX-License-Identifier: BSD-3-Clause

// -- the page -----------------------------------------------------------------------------------------------------

/** The state of a page, what it shows, and the messages that change it. */
class Page {
  constructor(root, connection) {
    this.connection = connection;
    observe(this, {
      ...{ place: "make", task: "more", method: "mrf", width: 256, height: 256, seed: 1, auto: true },
      ...{ picture: null, maps: [], part: null }, // the part of the picture that is the sample
      ...{ results: new Map(), shown: null, running: false, paused: false, runLayers: ["sample"] }, // the number of the shown result
      ...{ wanted: "picture", seen: null, tiled: false, latticeShown: false }, // the layers that is asked for, and that came
      ...{ said: "Connecting …", warned: "", hint: "", going: "", progress: 0, device: "", choosing: false }, // what is going on, and its share
      ...{ colours: [], examples: [], ready: false },
    });
    this.given = this.pending = null; // the file and its maps, to give them again to a server that was started anew
    this.restoring = false; // a saved view starts its own runs
    this.session = connection.key;
    this.seeds = []; // of the runs that follow
    this.last = { make: "more", paint: "hole" }; // the task of each place
    this.painting = new Painting(this);
    this.inside = new Inside(this);
    this.view = new View(this);
    this.lecture = new Lecture(this);
    this.build(root);
    this.awaited = new Map();
    connection.onmessage = (message, buffers) => {
      const handler = `on_${message.kind}`;
      batch(() => (this[handler] ? this : this.inside)[handler]?.(message, buffers));
      this.awaited.get(message.kind)?.(message);
      this.awaited.delete(message.kind);
    };
    connection.onstate = (state, reason) => this.connected(state, reason);
    connection.open();
  }

  send(message, buffers) {
    if (this.open) this.connection.send(message, buffers);
  }

  /** Wait for the next message of a kind. */
  next(kind) {
    return new Promise((done) => this.awaited.set(kind, done));
  }

  // -- state that follows from other state

  get job() {
    return TASKS[this.task].job;
  }

  get found() {
    return this.results.get(this.shown);
  }

  /** Whether the run is shown. */
  get watching() {
    return this.running && this.shown === null;
  }

  /** The layers of what is shown. */
  get layers() {
    const layers = this.found?.layers ?? (this.running ? this.runLayers : ["sample"]);
    return this.inside.at ? [...layers, "sets"] : layers;
  }

  get layer() {
    return this.layers.includes(this.wanted) ? this.wanted : made(this.layers);
  }

  /** The lattice that is drawn over the result; null if none is. */
  get lattice() {
    return this.latticeShown ? (this.found?.lattice ?? null) : null;
  }

  /** Columns and rows of the shown texture that its lattice fits; null if it has them. */
  get fitting() {
    const [rows, cols] = this.found?.lattice?.fitting ?? [];
    const { settings, width, height } = this.found ?? {};
    return settings?.job !== "synth" || !rows || (rows === height && cols === width) ? null : [cols, rows];
  }

  /** The controls of the method, or of a job that has its own; null before simdtex has told them. */
  get controls() {
    return this.ready ? this.options[this.job === "synth" ? this.method : this.job] : null;
  }

  /** Whether the result has no seam where it repeats. */
  get tiles() {
    const { job, method, options } = this.found?.settings ?? {};
    const boundary = this.ready && this.options[method]?.controls.find(({ name }) => name === "boundary");
    return job === "extend" || (job === "synth" && (!boundary || (options.boundary ?? boundary.default) === "torus"));
  }

  /** What is going on or, if that is not shown, how the shown result was made. */
  get doing() {
    const { width, height, seconds, settings, note } = this.found ?? {};
    if (!this.found || (this.going && !this.running)) return this.going;
    return `${width} × ${height} in ${seconds.toFixed(2)} s, seed ${settings.seed}.${note ? ` ${note.replace(/\.?$/, ".")}` : ""}`;
  }

  /** The classes of a result and their shares; before there is one, the classes that are painted. */
  get classes() {
    if (this.found?.shares.length || this.task !== "classes") return this.found?.shares ?? [];
    return [...new Set(this.painting.strokes.sample.map(({ label }) => label))].filter(Boolean).sort().map((label) => [label, null]);
  }

  // -- the picture

  /** Take files: one picture, the maps of one material, further maps of the picture, or a saved view. */
  async take(files, kind) {
    const taken = [...(files ?? [])];
    if (!taken.length) return;
    const large = taken.find(({ size }) => this.bytes && size > this.bytes);
    if (large) {
      this.warn(`${large.name} has ${large.size} bytes and at most ${this.bytes} are taken; give a smaller one.`);
      return;
    }
    this.busy(`Reading ${taken[0].name || "the picture"} …`);
    const read = taken.map(async (file) => ({ name: file.name || "pasted.png", bytes: new Uint8Array(await file.arrayBuffer()) }));
    const found = await Promise.all(read);
    if (kind === "map") for (const map of found) this.giveMap(map);
    else if (found[0].name.endsWith(".json")) await this.restoreView(found[0].bytes);
    else {
      this.send({ kind: "lead", names: found.map(({ name }) => name) });
      const [lead] = found.length > 1 ? found.splice((await this.next("lead")).place, 1) : found.splice(0, 1);
      this.give({ ...lead, maps: new Map(found.map((map) => [stem(map.name), map])) });
    }
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
    this.small = bitmap(bytes, ...message.preview);
    this.picture = message;
    this.maps = message.maps;
    this.setPart(same && !message.new ? this.part : message.part, false);
    if (!message.new) {
      if (message.settings && !before) this.restore(message.settings); // else the page has its own, perhaps later ones
      return;
    }
    if (this.pending) this.given = { ...this.pending, label: message.name };
    this.pending = null;
    if (this.refused) for (const options of Object.values(this.options)) options.values = {};
    this.refused = false;
    this.seeds = [];
    this.painting.restore();
    this.shown = null;
    this.done(0);
    this.say("Ready.");
    if (this.again) this.restore(this.again);
    else [this.width, this.height] = message.size;
    this.again = null;
    if (this.task !== "hole" && !this.restoring) this.make();
    this.restoring = false;
    if (["hole", "classes"].includes(this.task)) this.showLayer("sample");
  }

  /** The part, also where it is the whole picture. */
  get wholePart() {
    return this.part ?? [0, 0, this.picture?.width ?? 0, this.picture?.height ?? 0];
  }

  setPart(part, run = true) {
    const { width, height } = this.picture;
    this.part = part && part[2] === width && part[3] === height ? null : part;
    if (run) this.changed();
  }

  /** Let a finger on the preview choose the part, or scroll the page. */
  chooseByFinger(choosing) {
    this.choosing = choosing;
  }

  on_maps({ names }) {
    this.done(0);
    this.maps = names;
    if (names.length && (this.shown !== null || this.running)) this.make();
  }

  removeMap(name) {
    this.given?.maps.delete(name);
    this.send({ kind: "unmap", name });
  }

  // -- runs and results

  showLayer(layer) {
    this.wanted = layer;
  }

  /** The tasks of a place, for a list of choices. */
  tasks(place) {
    return Object.entries(TASKS).filter(([, one]) => one.place === place).map(([name, { label }]) => [name, label]);
  }

  go(place) {
    if (place in this.last && TASKS[this.task].place !== place) this.setTask(this.last[place], false);
    if (place === "why" && this.found) this.task = this.taskOf(this.found.settings);
    this.place = place;
  }

  setTask(task, run = true) {
    this.place = TASKS[task].place;
    this.last[this.place] = this.task = task;
    this.hint = "";
    if (this.place === "paint" && this.layer === "labels" && task !== "classes") this.showLayer("sample");
    if (["hole", "guide"].includes(task) && this.shown === null && !this.running) this.showLayer("sample");
    if (task === "classes" && this.layer !== "labels") this.showLayer("sample");
    if (run && !["hole", "guide"].includes(task)) this.changed();
  }

  setMethod(method) {
    this.method = method;
    this.changed();
  }

  setSize(width, height) {
    [this.width, this.height] = [width, height];
    this.changed();
  }

  reset() {
    this.controls.values = {};
    this.changed();
  }

  newSeed() {
    this.seed = Math.floor(Math.random() * 2 ** 32);
    this.make();
  }

  /** Make four results that differ in their seed alone, to choose from. */
  fourSeeds() {
    this.seed = Math.floor(Math.random() * 2 ** 32);
    this.make();
    this.seeds = [1, 2, 3].map((n) => (this.seed + n) % 2 ** 32);
  }

  /** Run again, soon, if that is to happen at every change. */
  changed() {
    clearTimeout(this.waiting);
    if (this.auto && this.picture && this.task !== "hole") this.waiting = setTimeout(() => this.make(), 60);
  }

  make() {
    if (!this.picture) {
      this.warn("There is no picture yet; drop one, or choose a file.");
      return;
    }
    const { job, task, method, width, height, seed, part } = this;
    const { sample, output, hole } = this.painting.strokes;
    const message = { kind: "make", job, method, width, height, seed, options: this.controls.values };
    if (task === "hole") Object.assign(message, { hole, of: PICTURE_LAYERS.includes(this.seen) ? null : this.shown });
    else if (task !== "classes") message.part = part;
    if (task === "classes" || task === "guide") message.guide = { sample, output };
    this.seeds = [];
    this.asked = structuredClone(message);
    this.busy("Preparing the run …");
    this.send(message);
  }

  /** Show the settings of a result. */
  restore(settings) {
    const { job, guide, method, width, height, seed, options } = settings;
    this.task = this.taskOf(settings);
    this.last[TASKS[this.task].place] = this.task;
    if (this.place !== "why") this.place = TASKS[this.task].place;
    if (job === "synth") [this.method, this.width, this.height] = [method, width, height];
    this.seed = seed;
    this.controls.values = options;
    this.setPart(settings.part ?? null, false);
    this.painting.restore({ guide, hole: settings.hole });
  }

  taskOf({ job, guide }) {
    return Object.keys(TASKS).find((task) => TASKS[task].job === job && (task === "guide") === Boolean(job === "synth" && guide));
  }

  /** What differs between the settings of two runs, in words. */
  differences(before, after) {
    const task = this.taskOf(after);
    if (!before || this.taskOf(before) !== task) return TASKS[task].label;
    const { controls } = this.options[after.job === "synth" ? after.method : after.job];
    const said = after.job === "synth" && before.method !== after.method ? [after.method] : [];
    for (const { name, label, default: usual } of said.length ? [] : controls) {
      const [from, to] = [before, after].map(({ options }) => options[name] ?? usual ?? "automatic");
      if (from !== to) said.push(`${label} ${from} to ${to}`);
    }
    if (before.width !== after.width || before.height !== after.height) said.push(`${after.width} × ${after.height}`);
    const other = (field) => JSON.stringify(before[field] ?? null) !== JSON.stringify(after[field] ?? null);
    said.push(...["part", "guide", "hole"].filter(other).map((field) => `another ${field}`));
    if (before.seed !== after.seed) said.push(`seed ${after.seed}`);
    return said.join(", ") || "the same again";
  }

  on_frame(message, [bytes]) {
    this.send({ kind: "shown" });
    if (!message.pane) this.seen = message.layer;
    this.view.show(message, bytes);
    if (message.of === "run") this.frames += 1;
  }

  on_progress({ fraction, doing }) {
    [this.progress, this.going] = [fraction, doing];
  }

  on_begun(message) {
    const before = this.layer;
    this.runLayers = message.layers;
    this.frames = 0;
    this.busy("Preparing the sample.");
    this.warned = this.hint = "";
    this.refused = false;
    [this.running, this.paused] = [true, false];
    this.select(null);
    this.say(message.from === null ? "Running." : `Continuing after level ${message.from}.`);
    if (before === "sample") this.showLayer(made(message.layers));
  }

  on_hint({ text }) {
    this.warned = "";
    this.done(0);
    this.hint = sentence(text);
  }

  on_ended() {
    this.running = false;
    this.done(0);
    this.say("Cancelled.");
  }

  on_result(message, [bytes]) {
    const { result, dropped } = message;
    this.running = false;
    this.done(1);
    const results = new Map(this.results).set(result, { ...message, thumbnail: bitmap(bytes, ...message.thumbnail) });
    const gone = dropped.filter((number) => results.delete(number));
    this.results = results;
    const words = gone.length ? ` Result ${gone.join(", ")} is no longer kept, to save memory.` : "";
    this.say(`Result ${result} is ready${this.shown === null ? "" : `; result ${this.shown} is shown`}.${words}`);
    const [next, ...others] = this.seeds;
    if (next === undefined) return;
    this.seed = next;
    this.make();
    this.seeds = others;
  }

  forget(result) {
    const results = new Map(this.results);
    results.delete(result);
    this.results = results;
    this.send({ kind: "forget", result });
  }

  on_selected({ result, settings }) {
    this.select(result);
    if (settings) this.restore(settings);
    const { found } = this;
    if (!found) {
      if (this.running) this.say(this.paused ? "Paused." : "Running.");
      return;
    }
    if (!this.said.startsWith(`Result ${result} is ready`)) this.say(`Result ${result} is shown.`);
    if (!settings && found.settings.job === "fill") this.painting.change({ ...this.painting.strokes, hole: [] });
  }

  /** Show a result, or the run. */
  select(result) {
    this.shown = result;
    this.inside.close();
    this.inside.look();
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
    const { place: moment, pixel } = this.inside;
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
    this.restoring = true;
    this.give({ name: given.name, bytes: given.bytes && read(given.bytes), maps: new Map() });
    await this.next("picture");
    for (const { name, bytes: map } of given.maps) {
      this.giveMap({ name, bytes: read(map) });
      await this.next("maps");
    }
    const numbers = [];
    for (const settings of [...runs].reverse()) {
      this.restore(settings);
      this.asked = structuredClone(settings);
      this.send({ ...settings, kind: "make" });
      numbers.unshift((await this.next("result")).result);
    }
    this.go("why");
    await this.next("inside");
    if (numbers.length > 1) {
      this.inside.look(numbers[1]);
      await this.next("inside");
    }
    if (moment) {
      this.inside.seekPlace(...moment);
      await this.next("moments");
    }
    this.tiled = saved.tiled;
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
    this.paused = !this.paused;
    this.say(this.paused ? "Paused." : "Running.");
  }

  cancel() {
    this.seeds = [];
    this.send({ kind: "cancel" });
  }

  // -- the connection

  on_hello(message, buffers) {
    this.bytes = message.bytes;
    this.device = message.device;
    if (!this.ready) {
      const options = ([name, controls]) => [name, new Options(controls, () => this.changed())];
      this.options = Object.fromEntries(Object.entries(message.controls).map(options));
      this.methods = Object.entries(message.methods);
      this.temperatures = message.scale;
      this.colours = message.colours.map((colour) => `rgb(${colour})`);
      this.examples = Object.entries(message.examples).map(([name, size], index) => [name, bitmap(buffers[index], ...size)]);
      this.ready = true;
    }
    this.say("Ready.");
    if (message.fresh) followLink(this);
    if (message.fresh) setTimeout(() => !this.picture && this.send({ kind: "demo" }), 300); // any message ends its run
    this.inside.close();
    this.results = new Map();
    this.shown = null;
    this.running = false;
    this.view.ask();
    const other = this.session && this.session !== message.session; // simdtex was started anew, or has forgotten the page
    this.session = message.session;
    if (!other || !message.fresh) return;
    if (this.given && this.given.label === this.picture?.name) {
      this.again = this.asked?.job === "fill" ? null : this.asked;
      this.give(this.given);
    } else {
      this.picture = null;
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
      if (still || this.picture) return;
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
    this.seeds = [];
    this.say("Nothing was made.");
  }

  connected(state, reason) {
    this.open = state === "open";
    this.root.classList.toggle("lost", state === "lost");
    if (state === "open") {
      this.warned = "";
      this.send({ kind: "hello" });
      return;
    }
    this.running = false;
    this.say("Not connected.");
    if (state === "ended") {
      this.warn("The kernel was started anew, and this widget is no longer connected. Run its cell again.");
      for (const one of this.root.querySelectorAll("button, input, select")) one.disabled = true;
      return;
    }
    this.warn(`${reason ? `${reason}.` : "The connection to simdtex is lost."} The page tries to connect again.`);
  }

  say(text) {
    this.said = text;
  }

  /** Say what goes on before its share is known. */
  busy(text) {
    [this.going, this.progress] = [text, null];
  }

  done(share) {
    [this.going, this.progress] = ["", share];
  }

  warn(text) {
    this.warned = text;
    if (!this.running) this.done(0);
  }

  close() {
    document.removeEventListener("paste", this.paste);
    this.view.observer.disconnect();
    this.connection.close();
  }

  // -- what it shows

  build(root) {
    const place = (name) => button(PLACES[name], () => this.go(name), { "aria-current": () => (this.place === name ? "page" : null), disabled: () => !this.picture });
    const lecture = button("Lecture: why this pixel?", (event) => this.lecture.start(event.currentTarget));
    const header = make(
      "header",
      {},
      make("h1", {}, "simdtex live"),
      make("nav", { class: "bar", "aria-label": "Places" }, ...Object.keys(PLACES).map(place)),
      lecture,
      make("p", { class: "device" }, () => this.device),
      make("p", { role: "status", class: "status" }, () => this.said),
    );
    const side = make("div", { class: "side" }, this.sampleSection(), this.optionsSection());
    const columns = make("div", { class: "columns", hidden: () => !this.picture }, this.resultSection(), side);
    this.root = make("main", { class: "simdtex", tabindex: -1 }, header, this.startSection(), columns, this.lecture.element, this.runBar());
    effect(() => (this.root.dataset.place = this.place));
    root.replaceChildren(this.root);
    this.root.addEventListener("dragover", (event) => event.preventDefault());
    this.root.addEventListener("drop", (event) => {
      event.preventDefault();
      this.take(event.dataTransfer.files, event.target.closest?.(".maps") ? "map" : "open");
    });
    this.root.addEventListener("keydown", (event) => this.painting.key(event));
    effect(() => {
      this.place;
      untracked(() => this.inside.toggled());
    });
    this.paste = (event) => this.take(event.clipboardData?.files, "open");
    (root.id === "simdtex-live" ? document : this.root).addEventListener("paste", this.paste);
  }

  /** A button that asks for files. */
  files(label, kind) {
    const input = make("input", { type: "file", multiple: true, accept: "image/*,.tif,.tiff,.npy,.json", onchange: () => this.take(input.files, kind) });
    return button(label, () => {
      input.value = "";
      input.click();
    });
  }

  /** What the page begins with. */
  startSection() {
    const example = ([name, picture]) => {
      const found = button(name, () => this.give({ name, maps: new Map() }));
      found.prepend(picture);
      return found;
    };
    this.demo = make("canvas", { class: "demo", width: 1, height: 1, role: "img", "aria-label": "A run: large shapes settle first." });
    return make(
      "section",
      { "aria-label": "Start", class: "start", hidden: () => this.picture },
      this.demo,
      make("h2", {}, "Drop a picture of a texture here"),
      make("p", {}, "or all maps of a material; or paste a picture, or choose a file:"),
      this.files("Choose a file", "open"),
      make("p", {}, "or try an example:"),
      make("div", { class: "examples" }, () => this.examples.map(example)),
    );
  }

  /** What runs, at the lower edge of the screen. */
  runBar() {
    const pausing = make("button", { type: "button", onclick: () => this.pause(), disabled: () => !this.running, hidden: () => !this.picture }, () => (this.paused ? "Resume" : "Pause"));
    return make(
      "footer",
      { hidden: () => !this.picture && !this.warned && !this.doing },
      make("p", { role: "alert", class: "alert", hidden: () => !this.warned }, () => this.warned),
      make("button", { type: "submit", class: "first", form: this.form.id, hidden: () => !this.picture }, () => TASKS[this.task].run),
      pausing,
      button("Cancel", () => this.cancel(), { disabled: () => !this.running, hidden: () => !this.picture }),
      make("progress", { max: 1, value: () => this.progress, "aria-label": "Progress", hidden: () => !this.picture && this.progress !== null }),
      make("p", { class: "doing" }, () => this.doing),
    );
  }

  sampleSection() {
    const preview = make("canvas", { class: "preview", role: "img", style: () => `touch-action: ${this.choosing ? "none" : "auto"}` });
    preview.addEventListener("pointerdown", (event) => this.drawPart(event));
    this.preview = preview;
    effect(() => this.showPart());
    const typed = SIDES.map((name, index) => labelled(name[0].toUpperCase() + name.slice(1), number({ min: 0, value: () => this.wholePart[index], onchange: ({ target }) => this.typePart(index, Number(target.value)) })));
    const whole = button("Whole picture", () => this.setPart(null));
    const finger = button("Choose a part with a finger", () => this.chooseByFinger(!this.choosing), { class: "finger", "aria-pressed": () => `${this.choosing}` });
    const map = (name) => make("li", {}, `${name} `, button("×", () => this.removeMap(name), { "aria-label": `Remove ${name}` }));
    const named = () => {
      const { name, width, height, values, more } = this.picture ?? {};
      return `${name}, ${width} × ${height}, ${values}${more ? ". The file has further frames or pages; this is the first." : ""}`;
    };
    return make(
      "section",
      { "aria-label": "Sample", class: "sample" },
      make("h2", {}, "Sample"),
      make("div", { class: "bar" }, make("span", { class: "named" }, named), this.files("Another picture", "open")),
      preview,
      make("details", {}, make("summary", {}, "The part that is the sample"), finger, make("fieldset", { class: "part" }, make("legend", {}, "Pixels"), ...typed, whole)),
      make(
        "details",
        { class: "maps" },
        make("summary", {}, "Further maps of the material"),
        make("p", {}, "Normal, height, roughness: each is arranged as the picture is."),
        this.files("Add maps", "map"),
        make("ul", {}, () => this.maps.map(map)),
      ),
    );
  }

  /** Draw the preview, dark where it is not the part. */
  showPart() {
    const { picture, preview, part } = this;
    if (!picture) return;
    [preview.width, preview.height] = picture.preview;
    preview.setAttribute("aria-label", `${picture.name}, ${picture.width} by ${picture.height} pixels. Drag over it to choose the part that is the sample.`);
    const context = preview.getContext("2d");
    context.drawImage(this.small, 0, 0);
    if (!part) return;
    const [x, y, w, h] = part.map((one) => (one * picture.preview[0]) / picture.width);
    context.fillStyle = "#0009";
    context.fillRect(0, 0, ...picture.preview);
    context.drawImage(this.small, x, y, w, h, x, y, w, h);
  }

  typePart(index, value) {
    const { width, height } = this.picture;
    const [x, y, w, h] = this.wholePart.map((one, n) => (n === index ? Math.round(value) : one));
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

  resultSection() {
    const { view } = this;
    const zoom = bar(
      button("−", () => view.zoom(-1), { "aria-label": "Zoom out" }),
      make("output", { "aria-label": "Zoom" }, () => `${Math.round(100 * view.unit)} %`),
      button("+", () => view.zoom(1), { "aria-label": "Zoom in" }),
      button("Fit", () => view.fit()),
    );
    const layer = choice([], () => this.showLayer(layer.value));
    effect(() => {
      layer.replaceChildren(...choices(this.layers.map((name) => [name, LAYERS[name] ?? name.replace(/^map /, "Map: ")])));
      layer.value = this.layer;
    });
    const tiled = checkbox({ checked: () => this.tiled, onchange: ({ target }) => (this.tiled = target.checked) });
    const lattice = labelled("Lattice", checkbox({ onchange: ({ target }) => (this.latticeShown = target.checked) }));
    effect(() => (lattice.hidden = !this.found?.lattice));
    const badge = make("span", { class: "badge", hidden: () => !this.tiles || this.layer !== "picture" }, "tiles: hold T for 3 × 3");
    const scale = make("span", { class: "scale", "aria-hidden": "true", hidden: () => !["use", "temperature"].includes(this.seen) });
    effect(() => this.ready && (scale.style.background = `linear-gradient(to right, ${this.temperatures.map((colour) => `rgb(${colour})`)})`));
    effect(() => view.canvas.setAttribute("aria-label", this.found ? `Result ${this.shown}: ${this.doing} Arrow keys move, plus and minus zoom, 0 fits.` : "The run, or the sample."));
    const share = ([label, one]) => {
      const swatch = make("span", { class: "swatch", "aria-hidden": "true" });
      swatch.style.background = this.colours[label];
      const name = label ? `Label ${label}` : "Unknown";
      return make("li", {}, swatch, one === null ? name : `${name}: ${(100 * one).toFixed(1)} %`);
    };
    return make(
      "section",
      { "aria-label": "Result", class: "result" },
      make("h2", {}, "Result"),
      bar(zoom, labelled("Layer", layer), labelled("Tiled 3 × 3", tiled), lattice), // what changes its width comes last
      make("div", { class: "stage" }, make("div", { class: "shown" }, this.painting.tools(), badge, view.element), this.keptSection()),
      make("p", { class: "legend", hidden: () => !LEGENDS[this.seen] }, scale, make("span", {}, () => LEGENDS[this.seen] ?? "")),
      make("p", { role: "status", class: "hint" }, () => this.hint),
      make("ul", { class: "classes", "aria-label": "Classes", hidden: () => !this.classes.length }, () => this.classes.map(share)),
      this.inside.element,
      this.recipeSection(),
    );
  }

  /** The results, and the files of the shown one; their place stays, so that nothing moves. */
  keptSection() {
    const download = (name) => button(name, () => this.send({ kind: "download", result: this.shown, name }), { "data-file": name });
    const current = (number) => ({ "aria-current": () => (this.shown === number ? "true" : null) });
    const numbers = () => [...this.results.keys()];
    const item = (number, index, all) => {
      const { thumbnail, settings, picture, width, height } = this.results.get(number);
      const what = this.differences(this.results.get(all[index - 1])?.settings, settings);
      const caption = make("span", {}, `Result ${number}, ${what}`);
      const show = button("", () => this.send({ kind: "select", result: number }), { title: `From ${picture}, ${width} × ${height}, seed ${settings.seed}`, ...current(number) });
      show.append(thumbnail, caption);
      return make("li", {}, show, button("×", () => this.forget(number), { "aria-label": `Delete result ${number}`, class: "delete" }));
    };
    const running = make("li", { class: "current", hidden: () => !this.running }, button("Current run", () => this.send({ kind: "select", result: null }), current(null)));
    const strip = make("ol", { class: "strip", "aria-label": "Results" }, () => [...numbers().map(item), running]);
    effect(() => this.results && strip.scrollTo(strip.scrollWidth, strip.scrollHeight));
    const files = bar();
    effect(() => this.found && files.replaceChildren(...this.found.files.map(download)));
    return make("div", { class: "kept" }, strip, make("section", { "aria-label": "Download", style: () => (this.found ? "" : "visibility: hidden") }, make("h3", {}, "Download"), files));
  }

  recipeSection() {
    let last = ""; // which stays in its place during a run
    const command = make("pre", { tabindex: 0, "aria-label": "Command line" }, () => (last = this.found?.command ?? last));
    return make(
      "section",
      { "aria-label": "The same bytes again", style: () => (this.found ? "" : "visibility: hidden") },
      make("p", {}, () => `This line makes the same bytes from the files in ${this.found?.files.at(-1)}:`),
      command,
      button("Copy the command line", () => this.copy(command.textContent)),
    );
  }

  optionsSection() {
    const side = (name) => number({ min: 1, max: 16384, value: () => this[name], onchange: ({ target }) => this.setSize(...(name === "width" ? [Number(target.value), this.height] : [this.width, Number(target.value)])) });
    const square = (pixels) => button(`${pixels}`, () => this.setSize(pixels, pixels), { "aria-label": `${pixels} × ${pixels}` });
    const fits = button("", () => this.setSize(...this.fitting), { class: "fitting", hidden: () => !this.fitting });
    effect(() => this.fitting && (fits.textContent = `Use ${this.fitting.join(" × ")}, which fits`));
    const task = choice(this.tasks("make"), () => this.setTask(task.value), { value: () => this.task });
    const made = labelled("Make", task);
    effect(() => (made.hidden = TASKS[this.task].place !== "make"));
    const method = choice([], () => this.setMethod(method.value));
    effect(() => {
      if (this.ready) method.replaceChildren(...choices(this.methods));
      method.value = this.method;
    });
    const methodField = labelled("Method", method);
    effect(() => (methodField.hidden = this.job !== "synth"));
    const seed = number({ min: 0, max: 4294967295, value: () => this.seed, onchange: ({ target }) => {
      this.seed = Number(target.value);
      this.changed();
    } });
    const auto = checkbox({ checked: () => this.auto, onchange: ({ target }) => (this.auto = target.checked) });
    const onsubmit = (event) => {
      event.preventDefault();
      this.make();
    };
    this.form = make(
      "form",
      { onsubmit, id: `simdtex-${++count}` },
      made,
      make(
        "fieldset",
        { hidden: () => this.job !== "synth" },
        make("legend", {}, "Size"),
        bar(...[256, 512, 1024].map(square), fits),
        bar(labelled("Result width", side("width")), labelled("Result height", side("height"))),
      ),
      make("div", {}, () => this.controls?.first ?? []),
      bar(labelled("Seed", seed), button("New seed", () => this.newSeed()), button("Four seeds", () => this.fourSeeds(), { hidden: () => this.job === "classify" })),
      labelled("Run at every change", auto),
      make("details", {}, make("summary", {}, "All options"), methodField, make("div", {}, () => this.controls?.others ?? []), button("Reset the options", () => this.reset())),
    );
    return make("section", { "aria-label": "Options", class: "options" }, make("h2", {}, "Options"), this.form);
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
  page.next("selected").then(() => page.go("why"));
}

// SPDX-License-Identifier: BSD-3-Clause

// -- a look inside a run ------------------------------------------------------------------------------------------

const TILE = 54; // pixels to a side of the picture of a neighbourhood, about
const FRAMES = 12; // of a sweep while the time line plays, at most
const PACE = 70; // milliseconds between two of them, at least
const HOW = "Click a pixel of the result, or press Enter in the view and move with the arrow keys.";
const NAMES = {
  distance: "distance (12)",
  coherence: "coherence",
  use: "cost of use",
  guide: "guide",
  lattice: "lattice",
  data: "data",
  soft: "soft data",
  novelty: "novelty",
  total: "total",
}; // of the terms of a cost

const sum = (numbers) => numbers.reduce((total, one) => total + one, 0);

/** A colour from white, 0, to orange, 1. */
const heat = (share) => [255 - 30 * share, 255 - 170 * share ** 0.7, 255 - 223 * share ** 0.7];

/** The time line of a run, and why the chosen pixel has its value. */
class Inside {
  constructor(page) {
    this.page = page;
    this.sweeps = [];
    observe(this, { at: null }); // [sweep, sets], null for the result
    this.goal = null; // the moment that was asked for last, as `at`
    this.waiting = this.late = false; // whether a moment is on its way, and whether the goal is another one
    this.pixel = null; // [row, column]
    this.beside = null; // the number of the result that is shown beside the selected one
    this.pinned = null; // the pixel of a result that is shown no more, its moment and layer
    this.asked = { order: null, trust: 0 }; // with which the pixel is explained: null, the order of the run
    this.looking = this.explaining = this.again = false; // whether an answer is awaited, and another one after it
    this.tables = []; // what the controls change, by pane
    this.line = new TimeLine(this);
    this.films = new Films(page);
    this.moment = make("output", { class: "moment" });
    this.playing = button("Play", () => this.play());
    this.choice = choice([], () => this.look(Number(this.choice.value) || null));
    this.captions = make("p", { class: "captions" });
    this.controls = this.dice();
    this.reasons = [0, 1].map(() => make("div", { class: "reason" }));
    const step = (text, label, by) => button(text, () => this.step(by), { "aria-label": label });
    const sweepStep = (text, label, by) => button(text, () => this.stepSweep(by), { "aria-label": label });
    this.body = make(
      "div",
      { hidden: true },
      bar(
        sweepStep("«", "A sweep back", -1),
        step("‹", "A set of sites back", -1),
        this.playing,
        step("›", "A set of sites on", 1),
        sweepStep("»", "A sweep on", 1),
        this.moment,
      ),
      this.line.element,
      bar(
        labelled("Beside it", this.choice),
        button("Save this view", () => this.page.saveView(), { class: "save" }),
        button("Copy a link", () => this.link(), { class: "save" }),
      ),
      this.captions,
      this.controls,
      make("div", { class: "reasons" }, ...this.reasons),
      this.films.element,
    );
    this.status = make("p", { role: "status" });
    this.element = make(
      "section",
      { class: "inside", "aria-label": "Why", hidden: () => !this.looks },
      this.status,
      this.body,
    );
  }

  get looks() {
    return this.page.place === "why";
  }

  get open() {
    return this.looks && !this.body.hidden;
  }

  /** Begin or end to look, as the page goes to its place or leaves it. */
  toggled() {
    if (this.looks) this.look(this.beside);
    else {
      this.close();
      this.pinned = null;
    }
  }

  /** Ask for the run of the selected result, and of the one beside it. */
  look(beside = null) {
    if (!this.looks) return;
    this.status.textContent = this.page.shown === null ? "Look inside when there is a result." : "The run is repeated …";
    this.beside = beside;
    this.page.view.split(beside !== null);
    this.looking = this.page.shown !== null;
    if (this.looking) this.page.send({ kind: "inside", open: true, beside });
  }

  /** Close the time line; the pixel and its moment come back with the next result. */
  close() {
    this.stop();
    if (this.pixel && this.open) this.pinned = { pixel: this.pixel, moment: this.place, layer: this.page.layer };
    if (!this.body.hidden) this.page.send({ kind: "inside", open: false });
    this.body.hidden = true;
    this.at = this.goal = this.beside = null;
    this.waiting = this.late = this.looking = this.explaining = this.again = false;
    this.unpick();
    this.page.view.split(false);
    if (this.page.layer === "sets") this.page.showLayer("picture");
  }

  /** Show why there is nothing to look into. */
  failed(text) {
    this.waiting = this.explaining = false;
    if (!this.page.view.panes[1].frame) this.page.view.split(false);
    if (this.looking && !this.body.hidden) this.close(); // the session has forgotten what was open
    if (this.looks && this.body.hidden) this.status.textContent = text;
  }

  on_inside({ panes }, buffers) {
    this.panes = panes;
    this.samples = panes.map(({ preview }, n) => bitmap(buffers[n], ...preview));
    [this.sweeps, this.body.hidden, this.looking] = [panes[0].sweeps, false, false];
    this.status.textContent = "";
    this.tables = [];
    this.line.build(this.sweeps);
    this.beside = panes[1]?.result ?? null;
    this.page.view.split(panes.length > 1);
    const others = [...this.page.results.values()].filter(({ result, layers }) => result !== panes[0].result && layers.includes("temperature"));
    this.choice.replaceChildren(...choices([["", "Nothing"], ...others.map(({ result }) => [`${result}`, `Result ${result}`])]));
    this.choice.value = this.beside ?? "";
    const [own, other] = panes.map(({ result }) => this.page.results.get(result));
    this.captions.textContent = other ? `Result ${other.result} beside it: ${this.page.differences(own.settings, other.settings)}.` : "";
    const [at] = panes.map(({ moment }) => moment);
    this.goal = at;
    this.show(at);
    const { pixel, moment, layer } = this.pinned ?? {};
    this.pinned = null;
    if (pixel) {
      const { height, width } = this.page.results.get(panes[0].result);
      this.pixel = [Math.min(pixel[0], height - 1), Math.min(pixel[1], width - 1)];
    }
    if (moment) this.seekPlace(...moment);
    else if (panes.length > 1 && at) this.seek(...at);
    else if (this.pixel) this.explain();
    else this.hint();
    if (moment && layer === "sets") this.page.showLayer(layer);
  }

  // -- the time line

  /** Go to a moment: so many sets of a sweep, null for all; the sweep after the last is the result. */
  seek(sweep, sets) {
    const number = clamp(sweep, 0, this.sweeps.length);
    this.goal = number < this.sweeps.length ? [number, sets ?? this.sweeps[number][2]] : null;
    if (this.waiting) this.late = true;
    else this.ask();
  }

  /** Go to a sweep of a level, or to the last one before it. */
  seekPlace(level, sweep, sets) {
    const found = this.sweeps.findLastIndex((one) => one[0] === level && one[1] <= sweep);
    this.seek(found < 0 ? this.sweeps.length : found, Math.min(sets, this.sweeps[found]?.[2] ?? 0));
  }

  /** The level, the sweep and the sets of the present moment; null for the result. */
  get place() {
    return this.at && [...this.sweeps[this.at[0]].slice(0, 2), this.at[1]];
  }

  /** Ask for the goal. */
  ask() {
    [this.waiting, this.late] = [true, false];
    const [number, sets] = this.goal ?? [];
    const [level, sweep] = this.goal ? this.sweeps[number] : [];
    this.page.send(this.goal ? { kind: "seek", level, sweep, sets } : { kind: "seek" });
  }

  on_moments({ moments }) {
    this.waiting = false;
    if (!this.late) [this.goal] = moments;
    this.show(moments[0]);
    if (this.late) this.ask();
    else if (this.pixel) this.explain();
  }

  /** Show where on the time line the view is. */
  show(moment) {
    this.at = moment;
    const [number, sets] = moment ?? [this.sweeps.length, 0];
    this.moment.textContent = moment ? this.describe(number, sets) : "The result.";
    this.line.show(number, sets, this.moment.textContent);
  }

  describe(number, sets) {
    const [level, sweep, all, sites, temperature] = this.sweeps[number];
    const last = this.sweeps.filter(([other]) => other === level).length;
    const state = temperature > 0 ? `mean temperature ${temperature.toFixed(3)}` : "free: all temperatures are 0";
    return `Level ${level}, sweep ${sweep} of ${last}, set ${sets} of ${all}, ${sites} sites in the sweep, ${state}.`;
  }

  step(by) {
    const [sweep, sets] = this.goal ?? [this.sweeps.length, 0];
    if (this.page.layer === "picture") this.page.showLayer("sets");
    if (sets + by > (this.sweeps[sweep]?.[2] ?? 0)) this.seek(sweep + 1, Math.min(by, this.sweeps[sweep + 1]?.[2] ?? 0));
    else if (sets + by < 0) this.seek(sweep - 1, sweep ? null : 0);
    else this.seek(sweep, sets + by);
  }

  stepSweep(by) {
    this.seek((this.goal?.[0] ?? this.sweeps.length) + by, null);
  }

  /** Act on a key of the line of time; return whether it is one. */
  timeKey(key) {
    const acts = {
      ...{ ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), ArrowDown: () => this.stepSweep(-1), ArrowUp: () => this.stepSweep(1) },
      ...{ Home: () => this.seek(0, 0), End: () => this.seek(this.sweeps.length) },
    };
    acts[key]?.();
    return key in acts;
  }

  play() {
    if (this.timer) {
      this.stop();
      return;
    }
    this.playing.textContent = "Stop";
    let [sweep, sets] = this.at ?? [0, 0];
    const next = () => {
      if (sweep >= this.sweeps.length) {
        this.stop();
        return;
      }
      const all = this.sweeps[sweep][2];
      if (sets >= all) [sweep, sets] = [sweep + 1, 0];
      else sets = Math.min(all, sets + Math.max(1, Math.ceil(all / FRAMES)));
      if (!this.waiting) this.seek(sweep, sets);
      this.timer = setTimeout(next, PACE);
    };
    next();
  }

  stop() {
    clearTimeout(this.timer);
    this.timer = null;
    this.playing.textContent = "Play";
  }

  // -- why

  hint() {
    this.controls.hidden = true;
    this.reasons[0].replaceChildren(make("p", {}, HOW));
    this.reasons[1].replaceChildren();
  }

  pick(row, col) {
    if (!this.open) return;
    const { rows, cols } = this.page.view.panes[0].frame ?? {};
    if (["sample", "use"].includes(this.page.seen) || !rows) return;
    const wrap = (n, side) => (this.page.tiled ? ((n % side) + side) % side : n);
    this.pixel = [clamp(wrap(row, rows), 0, rows - 1), clamp(wrap(col, cols), 0, cols - 1)];
    this.explain();
  }

  pickMiddle() {
    this.pick(this.page.view.rows >> 1, this.page.view.cols >> 1);
  }

  move(across, down) {
    const { rows, cols } = this.page.view;
    const [row, col] = this.pixel;
    const size = 2 ** (this.at ? this.sweeps[this.at[0]][0] : 0);
    this.pixel = [(row + down * size + rows) % rows, (col + across * size + cols) % cols];
    this.explain();
  }

  /** Another pixel than the chosen one, at random. */
  another() {
    return [this.page.view.rows, this.page.view.cols].map((side) => Math.floor(Math.random() * side));
  }

  unpick() {
    this.pixel = null;
    for (const pane of this.page.view.panes) pane.why = null;
    this.page.view.draw();
    this.hint();
  }

  /** Ask why; if an answer is on its way, after it. */
  explain() {
    this.again = this.explaining;
    if (!this.pixel || this.explaining) return;
    this.explaining = true;
    this.page.send({ kind: "explain", row: this.pixel[0], col: this.pixel[1], ...this.asked });
  }

  on_explained(why) {
    if (why.pane === this.panes.length - 1) {
      this.explaining = false;
      if (this.again) this.explain();
    }
    if (!this.pixel) return;
    why.confidence = why.trust?.map((each) => clamp(Math.max(...each), 0, 1));
    this.page.view.panes[why.pane].why = why;
    this.page.view.draw();
    const place = this.reasons[why.pane];
    const title = this.beside === null ? "" : `Result ${this.panes[why.pane].result}, `;
    const text = `${title}pixel (row ${why.pixel[0]}, column ${why.pixel[1]}). ${sentence(why.reason.replace(/\.$/, ""))}`;
    const heading = make("p", {}, text[0].toUpperCase() + text.slice(1));
    this.tables[why.pane] = null;
    this.controls.hidden = false;
    if (!why.candidates) {
      this.said.textContent = sentence(why.reason.replace(/\.$/, ""));
      place.replaceChildren(heading);
      return;
    }
    this.order.disabled = !why.orders;
    if (why.orders) [this.order.max, this.order.value] = [Math.min(why.orders, 32), why.order];
    const cooled = `Temperature ${why.temperature.toFixed(3)}, after the relaxation ${why.cooled.toFixed(3)}. Bandwidth h = ${why.bandwidth.toFixed(2)} grey levels.`;
    const white = (levels) => levels.map((pixel, n) => pixel.map((one) => one * why.confidence[n] + 255 * (1 - why.confidence[n])));
    const seen = [this.tile(why.offsets, white(why.pixels), null, 2 * TILE)];
    const structure = this.structure(why);
    if (structure) seen.push(this.tile(why.offsets, white(why.levels.map(structure)), null, 2 * TILE));
    const caption = `Its neighbourhood${structure ? ", and the same in the structure channel" : ""}; white: confidence 1 − t is 0.`;
    const around = make("figure", {}, bar(...seen), make("figcaption", {}, caption));
    place.replaceChildren(heading, make("p", {}, cooled), make("div", { class: "bar seen" }, around, this.marks(why)), this.table(why), ...this.density(why));
    this.follow();
  }

  /** A neighbourhood as a picture: pixels at offsets, and one in the middle. */
  tile(offsets, pixels, middle, about = TILE) {
    const radius = Math.max(...offsets.flat().map(Math.abs));
    const size = Math.max(3, Math.round(about / (2 * radius + 1)));
    const side = (2 * radius + 1) * size;
    const canvas = make("canvas", { width: side, height: side, class: "tile", "aria-hidden": "true" });
    const context = canvas.getContext("2d");
    const cell = (row, col, pixel) => {
      const [red, green, blue] = pixel.length < 3 ? [pixel[0], pixel[0], pixel[0]] : pixel;
      context.fillStyle = `rgb(${red} ${green} ${blue})`;
      context.fillRect((col + radius) * size, (row + radius) * size, size, size);
    };
    offsets.forEach(([row, col], n) => cell(row, col, pixels[n]));
    if (middle) cell(0, 0, middle);
    context.strokeStyle = HOLE;
    context.strokeRect(radius * size + 0.5, radius * size + 0.5, size - 1, size - 1);
    return canvas;
  }

  /** The sample with the candidates, the first by rank the brightest. */
  marks({ candidates, pane }) {
    const { width, height } = this.panes[pane];
    const small = this.samples[pane];
    const size = 220 / Math.max(width, height);
    const canvas = make("canvas", { width: width * size, height: height * size, "aria-hidden": "true" });
    const context = canvas.getContext("2d");
    context.imageSmoothingEnabled = canvas.width < small.width;
    context.drawImage(small, 0, 0, canvas.width, canvas.height);
    for (const { place, rank, taken } of [...candidates].reverse()) {
      const [x, y] = [(place[1] + 0.5) * size, (place[0] + 0.5) * size];
      for (const [colour, wide] of [["#000", 3], [taken ? HOLE : "#fff", 1.5]]) ring(context, x, y, taken ? 7 : 5, colour, wide);
      context.font = "bold 11px sans-serif";
      lettered(context, rank, x + 7, y - 3);
    }
    return make("figure", {}, canvas, make("figcaption", {}, "Candidates in the sample, by rank; the ring in colour is taken."));
  }

  /** A function from working levels to the grey of the structure channel, which has no picture; null without any. */
  structure({ channels, candidates }) {
    const hidden = channels.indexOf("structure");
    const most = Math.max(1, ...candidates.flatMap(({ values }) => values.map((one) => one[hidden])));
    return hidden < 0 ? null : (levels) => [(255 * Math.min(levels[hidden], most)) / most];
  }

  /** The candidates; the controls change their probabilities. */
  table(why) {
    const { candidates, offsets, pane, channels } = why;
    const structure = this.structure(why);
    const terms = candidates.map(({ values }) => why.levels.map((x, n) => x.map((level, c) => ((level - values[n + 1][c]) * why.trust[n][c]) ** 2)));
    const costs = Object.keys(candidates[0].costs);
    const tiles = ["picture", ...(structure ? ["structure"] : []), "difference"];
    const heads = [...tiles, "probability", "rank", ...costs.map((name) => NAMES[name] ?? name), "row, column", "continues"];
    const shown = tiles.length + 3; // columns of the lecture
    const most = Math.max(1e-9, ...terms.flatMap((each) => each.map(sum)));
    const rows = candidates.map((one, n) => {
      const [middle, ...around] = one.pixels;
      const pictures = [this.tile(offsets, around, middle), this.difference(offsets, terms[n], channels, most)];
      const [own, ...others] = structure ? one.values.map(structure) : [];
      if (own) pictures.splice(1, 0, this.tile(offsets, others, own));
      const [share, text] = [make("span", { class: "share" }), make("span")];
      const texts = [`${one.rank}${one.taken ? ", taken" : ""}`, ...costs.map((name) => one.costs[name].toFixed(1)), one.place.join(", "), one.continues];
      const numbers = texts.map((each, place) => make("td", { class: place > 1 ? "more" : null }, `${each}`));
      const cells = [...pictures.map((tile) => make("td", {}, tile)), make("td", { class: "bars" }, text, share), ...numbers];
      return { one, share, text, line: make("tr", { class: one.taken ? "taken" : null }, ...cells) };
    });
    const set = (probability) => {
      const greatest = Math.max(...rows.map(({ one }) => probability(one)));
      for (const { one, share, text } of rows) {
        text.textContent = probability(one).toPrecision(3);
        share.style.width = `${(100 * probability(one)) / greatest}%`;
      }
    };
    this.tables[pane] = { ...why, rows, set };
    return make(
      "div",
      { class: "wide", tabindex: 0, role: "region", "aria-label": `Candidates of result ${this.panes[pane].result}` },
      make("table", {}, make("thead", {}, make("tr", {}, ...heads.map((text, n) => make("th", { scope: "col", class: n < shown ? null : "more" }, text)))), make("tbody", {}, ...rows.map(({ line }) => line))),
    );
  }

  /** Controls of a pixel's choice: the bandwidth, which acts here; order and trust, by which it is explained again. */
  dice() {
    const range = (attributes, oninput) => make("input", { type: "range", ...attributes, oninput });
    const ask = (asked) => {
      Object.assign(this.asked, asked);
      this.explain();
    };
    this.width = range({ min: -2, max: 2, step: 0.02, value: 0 }, () => this.follow());
    this.order = range({ min: 1, max: 8, value: 8, disabled: true }, () => ask({ order: Number(this.order.value) }));
    this.trust = range({ min: 0, max: 1, step: 0.05, value: 0 }, () => ask({ trust: Number(this.trust.value) }));
    this.said = make("output");
    const reset = () => {
      this.width.value = this.trust.value = 0;
      ask({ order: null, trust: 0 });
    };
    return make(
      "div",
      { class: "bar dice" },
      labelled("Bandwidth h", this.width),
      labelled("Order", this.order),
      labelled("Trust", this.trust),
      button("Draw again", () => this.draw()),
      button("As in the run", reset),
      this.said,
    );
  }

  /** The weights of all candidates of a table with the bandwidth of the slider, and that. */
  weights({ totals, bandwidth }) {
    const h = bandwidth * 2 ** Number(this.width.value);
    return [totals.map((total) => Math.exp((totals[0] - total) / (2 * h * h))), h];
  }

  /** Show the probabilities with the bandwidth of the slider, and what all controls say. */
  follow() {
    const trust = this.asked.trust ? `; doubt t of the neighbours: ${Math.round(100 * (1 - this.asked.trust))} % of the run's` : "";
    const texts = this.tables.filter(Boolean).map((table) => {
      const [weights, h] = this.weights(table);
      const all = sum(weights);
      const wider = ({ costs }) => Math.exp((table.totals[0] - costs.total) / (2 * h * h)) / all;
      table.set(Number(this.width.value) ? wider : ({ probability }) => probability);
      const count = Math.round(1 / sum(weights.map((one) => (one / all) ** 2)));
      return `h = ${h.toFixed(2)}: ${count} candidates count; order ${table.order}, ${table.offsets.length} neighbours${trust}.`;
    });
    this.said.textContent = texts.join(" ");
  }

  /** Draw one of the candidates, without a change of the result. */
  draw() {
    const u = Math.random();
    const ranks = this.tables.filter(Boolean).map((table) => {
      const [weights] = this.weights(table);
      let rank = 0;
      for (let left = u * sum(weights) - weights[0]; left > 0 && rank < weights.length - 1; left -= weights[rank]) rank += 1;
      for (const { one, line } of table.rows) line.classList.toggle("again", one.rank === rank);
      return rank;
    });
    if (ranks.length) this.said.textContent = `The dice say ${u.toFixed(3)}: the candidate of rank ${ranks.join(" and ")}.`;
  }

  /** Copy an address that brings the view back. */
  link() {
    const link = linkOf(this.page);
    if (link) {
      history.replaceState(null, "", link);
      this.page.copy(location.href);
    } else this.page.warn("Only a run of an example can be linked, without maps and guide; save this view instead.");
  }

  on_schedule(message, pictures) {
    this.films.add(message, pictures);
  }

  /** The terms of equation (12) as a picture; a pixel names its own terms. */
  difference(offsets, terms, channels, most) {
    const tile = this.tile(offsets, terms.map((one) => heat(sum(one) / most)), null);
    const radius = Math.max(...offsets.flat().map(Math.abs));
    tile.addEventListener("pointermove", ({ offsetX, offsetY }) => {
      const cell = tile.clientWidth / (2 * radius + 1);
      const [row, col] = [Math.floor(offsetY / cell) - radius, Math.floor(offsetX / cell) - radius];
      const n = offsets.findIndex(([i, j]) => i === row && j === col);
      const each = n < 0 ? [] : terms[n].map((one, c) => `${channels[c]} ${one.toFixed(1)}`);
      tile.title = each.length ? `Neighbour ${row}, ${col}: (1 − t)² (x − y)² is ${each.join(", ")}.` : "";
    });
    return tile;
  }

  /** The LCPDF over grey levels, a bar chart for each channel. */
  density({ density, values }) {
    return (density?.bars ?? []).map((bars, channel) => {
      const [width, height] = [4 * bars.length, 80];
      const canvas = make("canvas", { width, height, role: "img", "aria-label": `LCPDF of channel ${channel}; drawn: ${values[channel]}` });
      const context = canvas.getContext("2d");
      const most = Math.max(...bars);
      bars.forEach((one, n) => {
        const drawn = density.starts[n] <= values[channel] && !(density.starts[n + 1] <= values[channel]);
        context.fillStyle = drawn ? HOLE : "#7d8a8c";
        context.fillRect(4 * n, height - (height * one) / most, 3, (height * one) / most);
      });
      return make("figure", {}, canvas, make("figcaption", {}, `LCPDF over grey levels${values.length > 1 ? ` of channel ${channel}` : ""}; drawn: ${values[channel]}.`));
    });
  }
}

// -- the lecture --------------------------------------------------------------------------------------------------

// The model of the paper, with a probability for every candidate; JSON, which docs/recorded.py reads.
const PLAIN = {
  "relaxation": "gibbs", "pixel": "density", "search": "exact", "order": 8, "levels": 2, "bandwidth": 0.6,
  "lattice": "none", "structure": 0, "coherence": 0, "balance": 0, "novelty": 0, "finish": 0
};
const SIDE = 32; // pixels of its picture; the sample has half as many more

const KEYS = "Enter: on; F: full screen; ← →: a set; ↑ ↓: a sweep; space: play; N: another pixel; Escape: close.";

const LECTURE = [
  [".panes", "What does the model know about a texture?", "Only these pixels. No edge, colour or shape is described anywhere: every rule that follows is read off the sample."],
  [".panes", "Which pixels decide about this one?", "{near:Its neighbours}, the outlined pixels: a Markov random field. A neighbour counts as far as it is trusted, 1 − t: outlines are strong where {hot:temperatures} t are low."],
  [".reasons", "Where in the sample does it look like this?", "Each line is a place of the sample beside the pixel's neighbourhood. {differs:Orange} is what differs: the terms of equation (12), which add up to the distance. A small distance is a large probability, and {taken:one place is drawn}. Move h, order and trust, or draw again."],
  [".line", "When is a pixel certain?", "A relaxed pixel gets the mean {hot:temperature} of its neighbours, less a little: equation (13). Bright is hot, and {hot:high bars} are. When all pixels are cold, the level is at its equilibrium."],
  [".line", "Why are there so few pixels at first?", "Local rules spread large shapes slowly. Every second pixel comes first, so that a neighbourhood reaches twice as far; they stay, and the others are drawn around them."],
  [".panes", "May all pixels change at the same time?", "Only pixels that are not neighbours: each is drawn given its neighbours, which must not change meanwhile. {taken:The coloured pixels} are such a set, a step of a schedule. In 1998, 16,384 processors relaxed one set after another."],
]; // what is pointed at, a question, and its answer

/** Six questions and answers on a run of the plain model. */
class Lecture {
  constructor(page) {
    this.page = page;
    this.title = make("h2", { id: "simdtex-lecture" });
    this.text = make("p", { role: "status" });
    this.forth = button("Answer", () => this.on(), { class: "next" });
    this.back = button("Back", () => this.go(this.number - 1));
    const buttons = bar(this.back, this.forth, button("Full screen (F)", () => this.full()), button("Close", () => this.close()));
    this.element = make("section", { class: "questions", role: "dialog", "aria-labelledby": "simdtex-lecture", hidden: true, tabindex: -1, title: KEYS }, this.title, this.text, buttons);
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  /** Begin, with an example if there is no picture; an error of a run or of a look inside ends it. */
  async start(opener) {
    const { page } = this;
    this.opener = opener;
    const done = (kind) => Promise.race([page.next(kind), page.next("error")]);
    if (!page.picture) {
      page.give({ name: "gravel", maps: new Map() });
      await done("picture");
      if (!page.picture) return;
    }
    const { width, height } = page.picture;
    const part = [0, 0, ...[width, height].map((side) => Math.min(side, SIDE + SIDE / 2))];
    this.run = { kind: "make", job: "synth", method: "mrf", width: SIDE, height: SIDE, seed: 1, options: PLAIN, part };
    page.send(this.run);
    let made = page.connection instanceof Recording ? page.results.get(page.shown) : null;
    while (made?.settings.options.relaxation !== PLAIN.relaxation || made.width !== SIDE) {
      made = await done("result");
      if (made.kind === "error") return;
    }
    if (page.shown !== made.result) page.send({ kind: "select", result: made.result });
    if (page.inside.looks) page.inside.look();
    else page.go("why");
    await done("inside");
    if (!page.inside.open) return;
    this.element.hidden = false;
    page.root.prepend(this.element);
    page.root.classList.add("lecture");
    page.view.fit();
    this.go(0);
    this.element.focus();
  }

  /** Show a question; its answer follows. */
  go(number) {
    if (number >= LECTURE.length) {
      this.close();
      return;
    }
    this.number = number;
    const [place, title] = LECTURE[number];
    this.title.textContent = `${number + 1} of ${LECTURE.length}: ${title}`;
    this.text.textContent = "What do you expect?";
    this.back.disabled = number === 0;
    this.forth.textContent = "Answer";
    const { inside } = this.page;
    const finest = inside.sweeps.findIndex(([level]) => level === 0);
    this.page.showLayer(["sample", , , "temperature", , "sets"][number] ?? "picture");
    const moments = [[inside.sweeps.length, 0], [finest + 1, null], [finest + 1, null], [finest + 1, null], [finest - 1, null], [finest + 1, 1]];
    if (number === 0) inside.unpick();
    else inside.pixel ??= [9, 9];
    inside.seek(...moments[number]);
    this.page.root.classList.remove("filmed");
    if (number === LECTURE.length - 1) inside.films.ask(this.run);
    this.point(place);
  }

  /** Show the answer, or the next question. */
  on() {
    const { inside } = this.page;
    if (this.forth.textContent !== "Answer") this.go(this.number + 1);
    else {
      this.text.replaceChildren(...worded(LECTURE[this.number][2]));
      if (this.number === LECTURE.length - 1) {
        this.page.root.classList.add("filmed");
        inside.films.play();
      }
      this.forth.textContent = this.number === LECTURE.length - 1 ? "End" : "Next";
    }
  }

  key(event) {
    const { inside } = this.page;
    const keys = {
      ...{ Escape: () => this.close(), Enter: () => this.on(), f: () => this.full(), n: () => inside.pick(...inside.another()) },
      " ": () => inside.play(),
    };
    const act = keys[event.key.length > 1 ? event.key : event.key.toLowerCase()];
    if (event.target.tagName === "BUTTON" && ["Enter", " "].includes(event.key)) return;
    if (!act && !inside.timeKey(event.key)) return;
    event.preventDefault();
    act?.();
  }

  /** Fill the screen, in large letters; or leave it. */
  full() {
    if (document.fullscreenElement) document.exitFullscreen();
    else this.page.root.requestFullscreen?.();
  }

  point(place) {
    this.page.root.querySelector(".pointed")?.classList.remove("pointed");
    const found = place && this.page.root.querySelector(place);
    found?.classList.add("pointed");
  }

  close() {
    if (document.fullscreenElement) document.exitFullscreen();
    this.element.hidden = true;
    this.page.root.classList.remove("lecture", "filmed");
    this.page.view.fit();
    this.point(null);
    this.opener.focus();
  }
}

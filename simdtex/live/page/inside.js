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
    const range = (label, onchange) => make("input", { type: "range", min: 0, max: 0, value: 0, step: 1, "aria-label": label, oninput: onchange });
    this.sweepRange = range("Sweep", () => this.seek(Number(this.sweepRange.value), null));
    this.setRange = range("Set of sites", () => this.seek(this.at[0], Number(this.setRange.value)));
    this.moment = make("output", { class: "moment" });
    this.playing = button("Play", () => this.play());
    this.choice = choice([], () => this.look(Number(this.choice.value) || null));
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
        labelled("Beside it", this.choice),
        button("Save this view", () => this.page.saveView(), { class: "save" }),
      ),
      make("div", { class: "lines" }, make("span", {}, "Sweep"), this.sweepRange, make("span", {}, "Set"), this.setRange),
      this.moment,
      make("div", { class: "reasons" }, ...this.reasons),
    );
    this.status = make("p", { role: "status" });
    this.element = make(
      "details",
      { class: "inside", ontoggle: () => this.toggled() },
      make("summary", {}, "Look inside: see why each pixel has its value"),
      this.status,
      this.body,
    );
  }

  get open() {
    return this.element.open && !this.body.hidden;
  }

  toggled() {
    if (this.element.open) this.look(this.beside);
    else this.close();
  }

  /** Ask for the run of the selected result, and of the one beside it. */
  look(beside = null) {
    if (!this.element.open) return;
    this.status.textContent = this.page.shown === null ? "Look inside when there is a result." : "The run is repeated …";
    this.beside = beside;
    this.page.view.split(beside !== null);
    if (this.page.shown !== null) this.page.send({ kind: "inside", open: true, beside });
  }

  /** Close the time line. */
  close() {
    this.stop();
    if (!this.body.hidden) this.page.send({ kind: "inside", open: false });
    this.body.hidden = true;
    this.at = this.goal = this.beside = null;
    this.waiting = this.late = false;
    this.unpick();
    this.page.view.split(false);
    if (this.page.layer === "sets") this.page.showLayer("picture");
  }

  /** Show why there is nothing to look into. */
  failed(text) {
    this.waiting = false;
    if (!this.page.view.panes[1].frame) this.page.view.split(false);
    if (this.element.open && this.body.hidden) this.status.textContent = text;
  }

  on_inside({ panes }, buffers) {
    this.panes = panes;
    this.samples = panes.map(({ preview }, n) => bitmap(buffers[n], ...preview));
    [this.sweeps, this.body.hidden] = [panes[0].sweeps, false];
    this.status.textContent = "";
    this.beside = panes[1]?.result ?? null;
    this.page.view.split(panes.length > 1);
    const others = [...this.page.results.values()].filter(({ result, layers }) => result !== panes[0].result && layers.includes("temperature"));
    this.choice.replaceChildren(...choices([["", "Nothing"], ...others.map(({ result }) => [`${result}`, `Result ${result}`])]));
    this.choice.value = this.beside ?? "";
    this.sweepRange.max = this.sweeps.length;
    const [at] = panes.map(({ moment }) => moment);
    this.goal = at;
    this.show(at);
    if (panes.length > 1 && at) this.seek(...at);
    if (this.pixel) this.explain();
    else this.hint();
  }

  // -- the time line

  /** Go to a moment: so many sets of a sweep, null for all; the sweep after the last is the result. */
  seek(sweep, sets) {
    const number = clamp(sweep, 0, this.sweeps.length);
    this.goal = number < this.sweeps.length ? [number, sets ?? this.sweeps[number][2]] : null;
    if (this.waiting) this.late = true;
    else this.ask();
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
    this.sweepRange.value = number;
    this.setRange.disabled = !moment;
    this.setRange.max = moment ? this.sweeps[number][2] : 0;
    this.setRange.value = sets;
    this.moment.textContent = moment ? this.describe(number, sets) : "The result.";
    this.sweepRange.setAttribute("aria-valuetext", this.moment.textContent);
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

  explain() {
    this.page.send({ kind: "explain", row: this.pixel[0], col: this.pixel[1] });
  }

  on_explained(why) {
    if (!this.pixel) return;
    this.page.view.panes[why.pane].why = why;
    this.page.view.draw();
    const place = this.reasons[why.pane];
    const title = this.beside === null ? "" : `Result ${this.panes[why.pane].result}, `;
    const text = `${title}pixel (row ${why.pixel[0]}, column ${why.pixel[1]}). ${sentence(why.reason.replace(/\.$/, ""))}`;
    const heading = make("p", {}, text[0].toUpperCase() + text.slice(1));
    if (!why.candidates) {
      place.replaceChildren(heading);
      return;
    }
    const cooled = `Temperature ${why.temperature.toFixed(3)}, after the relaxation ${why.cooled.toFixed(3)}. Bandwidth h = ${why.bandwidth.toFixed(2)} grey levels.`;
    const white = (levels) => levels.map((pixel, n) => pixel.map((one) => one * why.confidence[n] + 255 * (1 - why.confidence[n])));
    const seen = [this.tile(why.offsets, white(why.pixels), null, 2 * TILE)];
    const structure = this.structure(why);
    if (structure) seen.push(this.tile(why.offsets, white(why.levels.map(structure)), null, 2 * TILE));
    const caption = `Its neighbourhood${structure ? ", and the same in the structure channel" : ""}; white: confidence 1 − t is 0.`;
    const around = make("figure", {}, bar(...seen), make("figcaption", {}, caption));
    place.replaceChildren(heading, make("p", {}, cooled), make("div", { class: "bar seen" }, around, this.marks(why)), ...this.table(why), ...this.density(why));
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

  /** The candidates, and controls that change their probabilities: h, and another draw. */
  table(why) {
    const { candidates, offsets, pane, channels, totals, bandwidth } = why;
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
    set(({ probability }) => probability);
    const scrolled = make(
      "div",
      { class: "wide", tabindex: 0, role: "region", "aria-label": `Candidates of result ${this.panes[pane].result}` },
      make("table", {}, make("thead", {}, make("tr", {}, ...heads.map((text, n) => make("th", { scope: "col", class: n < shown ? null : "more" }, text)))), make("tbody", {}, ...rows.map(({ line }) => line))),
    );
    return [scrolled, this.dice(rows, set, totals, bandwidth)];
  }

  /** Controls of a site's choice: the bandwidth, which acts on the probabilities at once, and another draw. */
  dice(rows, set, totals, bandwidth) {
    let weights = null;
    const weight = (total, h) => Math.exp((totals[0] - total) / (2 * h * h));
    const said = make("output", {}, "");
    const width = make("input", { type: "range", min: -2, max: 2, step: 0.02, value: 0 });
    const follow = () => {
      const h = bandwidth * 2 ** Number(width.value);
      weights = totals.map((total) => weight(total, h));
      const all = sum(weights);
      set(({ costs }) => weight(costs.total, h) / all);
      said.textContent = `h = ${h.toFixed(2)}: ${Math.round(1 / sum(weights.map((one) => (one / all) ** 2)))} candidates count.`;
    };
    width.addEventListener("input", follow);
    const draw = () => {
      if (!weights) follow();
      const u = Math.random();
      let rank = 0;
      for (let left = u * sum(weights) - weights[0]; left > 0 && rank < weights.length - 1; left -= weights[rank]) rank += 1;
      said.textContent = `The dice say ${u.toFixed(3)}: the candidate of rank ${rank}.`;
      for (const { one, line } of rows) line.classList.toggle("again", one.rank === rank);
    };
    width.setAttribute("aria-label", "Bandwidth h");
    return make("div", { class: "bar dice" }, "Bandwidth h", width, button("Draw again", draw), said);
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

const PLAIN = {
  ...{ relaxation: "gibbs", pixel: "density", search: "exact", order: 8, levels: 2, bandwidth: 0.6, lattice: "none" },
  ...{ structure: 0, coherence: 0, balance: 0, novelty: 0, finish: 0 },
}; // the model of the paper, with a probability for every candidate
const SIDE = 32; // pixels of its picture; the sample has half as many more

const KEYS = "Enter: on; F: full screen; ← →: a set; ↑ ↓: a sweep; space: play; N: another pixel; Escape: close.";

const LECTURE = [
  [".panes", "What does the model know about a texture?", "Only these pixels. No edge, colour or shape is described anywhere: every rule that follows is read off the sample."],
  [".panes", "Which pixels decide about this one?", "Its neighbours, the outlined pixels: a Markov random field. A neighbour counts as far as it is trusted, 1 − t: outlines are strong where temperatures t are low."],
  [".reasons", "Where in the sample does it look like this?", "Each line is a place of the sample beside the pixel's neighbourhood. Orange is what differs: the terms of equation (12), which add up to the distance. A small distance is a large probability, and one place is drawn. Move h, or draw again."],
  [".lines", "When is a pixel certain?", "A relaxed pixel gets the mean temperature of its neighbours, less a little: equation (13). Bright is hot. When all pixels are cold, the level is at its equilibrium."],
  [".lines", "Why are there so few pixels at first?", "Local rules spread large shapes slowly. Every second pixel comes first, so that a neighbourhood reaches twice as far; they stay, and the others are drawn around them."],
  [".panes", "May all pixels change at the same time?", "Only pixels that are not neighbours: each is drawn given its neighbours, which must not move meanwhile. The coloured pixels are such a set. In 1998, 16,384 processors relaxed one set after another."],
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
    this.element = make("section", { class: "tour", role: "dialog", "aria-labelledby": "simdtex-lecture", hidden: true, tabindex: -1, title: KEYS }, this.title, this.text, buttons);
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
    page.send({ kind: "make", job: "synth", method: "mrf", width: SIDE, height: SIDE, seed: 1, options: PLAIN, part });
    let made = page.connection instanceof Recording ? page.results.get(page.shown) : null;
    while (made?.settings.options.relaxation !== PLAIN.relaxation || made.width !== SIDE) {
      made = await done("result");
      if (made.kind === "error") return;
    }
    if (page.shown !== made.result) page.send({ kind: "select", result: made.result });
    if (page.inside.element.open) page.inside.look();
    page.inside.element.open = true;
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
    const moments = [[inside.sweeps.length, 0], [finest + 1, null], [finest + 1, null], [finest + 1, null], [finest, 0], [finest + 1, 1]];
    if (number === 0) inside.unpick();
    else inside.pixel ??= [9, 9];
    inside.seek(...moments[number]);
    this.point(place);
  }

  /** Show the answer, or the next question. */
  on() {
    if (this.forth.textContent !== "Answer") this.go(this.number + 1);
    else {
      [, , this.text.textContent] = LECTURE[this.number];
      this.forth.textContent = this.number === LECTURE.length - 1 ? "End" : "Next";
    }
  }

  key(event) {
    const { inside } = this.page;
    const keys = {
      ...{ Escape: () => this.close(), Enter: () => this.on(), f: () => this.full(), n: () => inside.pick(...inside.another()) },
      ...{ ArrowLeft: () => inside.step(-1), ArrowRight: () => inside.step(1), ArrowUp: () => inside.stepSweep(-1), ArrowDown: () => inside.stepSweep(1) },
      " ": () => inside.play(),
    };
    const act = keys[event.key.length > 1 ? event.key : event.key.toLowerCase()];
    if (!act || event.target.tagName === "BUTTON" && ["Enter", " "].includes(event.key)) return;
    event.preventDefault();
    act();
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
    this.page.root.classList.remove("lecture");
    this.page.view.fit();
    this.point(null);
    this.opener.focus();
  }
}

// SPDX-License-Identifier: BSD-3-Clause

// -- the line of time, films, words and links of a look inside ---------------------------------------------------

const TICKS = 24; // on the line of time for the sets of a sweep, at most
const BEAT = 260; // milliseconds for a picture of a film

/** All sweeps of a run, level by level, and the present moment in them. */
class TimeLine {
  constructor(inside) {
    this.inside = inside;
    this.mark = make("span", { class: "mark" });
    const onkeydown = (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !inside.timeKey(event.key)) return;
      event.preventDefault();
      event.stopPropagation(); // a notebook has its own meaning for keys
    };
    const onpointerdown = (event) => {
      if (event.button) return;
      this.seek(event);
      drag(this.element, event, (now) => this.seek(now), () => {});
    };
    this.element = make("div", { class: "line", role: "slider", tabindex: 0, "aria-label": "Time", "aria-valuemin": 0, onkeydown, onpointerdown });
  }

  /** Show the sweeps: a band for each level, a bar as high as the mean temperature, a tick for each set. */
  build(sweeps) {
    this.cells = sweeps.map(([, , sets, , temperature]) => {
      const height = make("i");
      height.style.height = `${100 * temperature}%`;
      const cell = make("div", { class: "sweep" }, height);
      cell.style.setProperty("--sets", sets > TICKS ? 1 : sets);
      return cell;
    });
    const band = (level) => {
      const own = this.cells.filter((_, n) => sweeps[n][0] === level);
      const size = ["full", "half"][level] ?? `1/${2 ** level}`;
      const element = make("div", { class: "band" }, make("div", {}, ...own), make("span", {}, `level ${level} (${size} size)`));
      element.style.flexGrow = own.length;
      return element;
    };
    const bands = [...new Set(sweeps.map(([level]) => level))].map(band);
    this.cells.push(make("div", { class: "sweep" }));
    this.element.replaceChildren(...bands, make("div", { class: "band end" }, make("div", {}, this.cells.at(-1)), make("span", {}, "result")));
    this.element.setAttribute("aria-valuemax", sweeps.length);
  }

  show(number, sets, text) {
    const share = sets / (this.inside.sweeps[number]?.[2] ?? 1);
    this.cells.forEach((cell, n) => cell.classList.toggle("now", n === number));
    this.cells[number].append(this.mark);
    this.mark.style.left = `${100 * share}%`;
    this.element.setAttribute("aria-valuenow", number + share);
    this.element.setAttribute("aria-valuetext", text);
  }

  seek({ clientX }) {
    const boxes = this.cells.map((cell) => cell.getBoundingClientRect());
    const number = boxes.filter(({ right }) => right <= clientX).length;
    const { left, width } = boxes[number] ?? boxes.at(-1);
    this.inside.seek(number, Math.round(clamp((clientX - left) / width, 0, 1) * (this.inside.sweeps[number]?.[2] ?? 0)));
  }
}

/** Runs of the same model with four schedules, as films of the sites that relax together. */
class Films {
  constructor(page) {
    this.page = page;
    this.element = make("div", { class: "films" });
  }

  ask(request) {
    const asked = JSON.stringify([request, this.page.picture.name]);
    if (asked === this.asked && this.films.length) return;
    this.asked = asked;
    this.element.replaceChildren(make("p", {}, "Four runs are made, one for each schedule …"));
    this.films = [];
    this.page.send({ ...request, kind: "schedules" });
  }

  add({ name, width, height, steps, sweeps, together }, pictures) {
    if (!this.films?.length) this.element.replaceChildren();
    const canvas = make("canvas", { width, height, role: "img", "aria-label": `Sites that relax together: ${name}` });
    const counted = `${steps} ${steps === 1 ? "step" : "steps"} a sweep, ${sweeps} sweeps. `;
    const share = `${Math.round(100 * together)} % of the pixels change at the same time as a neighbour.`;
    const caption = make("figcaption", {}, make("strong", {}, name), ` ${counted}${together ? share : "No two neighbours change at the same time."}`);
    this.element.append(make("figure", {}, canvas, caption));
    this.films.push({ canvas, pictures: pictures.map((bytes) => bitmap(bytes, width, height)) });
    this.play();
  }

  play() {
    clearTimeout(this.timer);
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    let number = 0;
    const next = () => {
      for (const { canvas, pictures } of this.films ?? []) canvas.getContext("2d").drawImage(pictures[number % pictures.length], 0, 0);
      number += 1;
      if (!still && this.element.offsetParent) this.timer = setTimeout(next, BEAT);
    };
    next();
  }
}

/** The nodes of a text in which `{kind:words}` have the colour of what they name in the figure. */
function worded(text) {
  return text.split(/\{(\w+:[^}]*)\}/).map((part, n) => {
    const [, kind, words] = n % 2 ? part.match(/^(\w+):(.*)$/) : [];
    return kind ? make("b", { class: `word ${kind}` }, words) : part;
  });
}

// -- links

/** The end of an address that brings a look into a run of an example back; null where none does. */
function linkOf({ given, results, shown, inside, layer }) {
  const { job, method, width, height, seed, options, part, guide } = results.get(shown)?.settings ?? {};
  if (job !== "synth" || !given || given.bytes || given.maps.size || guide) return null;
  const fields = { method, size: [width, height], seed, ...options, part, pixel: inside.pixel, moment: inside.place, layer };
  const pairs = Object.entries(fields).filter(([, value]) => value !== null && value !== undefined);
  return `#${given.name}&${pairs.map(([name, value]) => `${name}=${encodeURIComponent(value).replaceAll("%2C", ",")}`).join("&")}`;
}

/** A view as `saveView` saves it, from the end of an address. */
function viewOf(hash) {
  const [name, ...pairs] = hash.slice(1).split("&").map(decodeURIComponent);
  const one = (text) => ({ true: true, false: false })[text] ?? (text === "" || Number.isNaN(Number(text)) ? text : Number(text));
  const fields = pairs.map((pair) => [pair.split("=")[0], pair.slice(pair.indexOf("=") + 1)]);
  const { method = "mrf", size = "256,256", seed = 1, part, pixel, moment, layer = "picture", ...options } = Object.fromEntries(fields);
  const numbers = (text) => text?.split(",").map(Number);
  const [width, height] = numbers(size);
  for (const each of Object.keys(options)) options[each] = one(options[each]);
  const run = { job: "synth", method, width, height, seed: Number(seed), options, part: numbers(part) ?? null };
  const shown = { moment: numbers(moment) ?? null, pixel: numbers(pixel) ?? null, layer, tiled: false, left: 0, top: 0, unit: 1 };
  return { simdtex: "view", given: { name, maps: [] }, runs: [run], ...shown };
}

/** Bring back what the address of the page names, now and when it changes. */
async function followLink(page) {
  if (page.root.parentElement?.id !== "simdtex-live") return; // the address of a notebook is not the page's
  window.onhashchange = () => followLink(page);
  if (location.hash.length < 2) return;
  const view = viewOf(location.hash);
  if (!page.examples.some(([name]) => name === view.given.name)) {
    page.warn(`There is no example "${view.given.name}", which the link names; choose one on the page.`);
    return;
  }
  await page.restoreView(new TextEncoder().encode(JSON.stringify(view)));
  page.view.fit();
}

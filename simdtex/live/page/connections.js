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
  sets: "Sites that relax together",
  faults: "Faults of the lattice",
};
const TASKS = {
  more: { job: "synth", place: "make", label: "More of the texture", run: "Make the texture" },
  seamless: { job: "extend", place: "make", label: "A seamless picture", run: "Make it seamless" },
  hole: { job: "fill", place: "paint", label: "A hole to fill", run: "Fill the hole" },
  guide: { job: "synth", place: "paint", label: "A guide: what goes where", run: "Make the texture" },
  classes: { job: "classify", place: "paint", label: "Classes of a picture", run: "Classify the picture" },
};
const PLACES = { make: "Make", paint: "Paint", why: "Why" };
const PICTURE_LAYERS = ["sample", "labels"]; // which show the picture itself
const SIDES = ["left", "top", "width", "height"];
const MAX_PIXELS = 2 ** 22; // of a frame
const PIECE = 2 ** 20; // bytes of a file that are sent at a time
const CONTROLS = ["button", "input", "select", "summary"];
const LEGENDS = {
  arrangement: "Each place of the sample has a colour of its own. An area without edges was copied whole.",
  use: "Black: never taken. Yellow: taken most often.",
  sets: "Magenta: the sites that relaxed last, all together. Grey-blue: those that relaxed earlier in the sweep.",
  faults: "Magenta: the pattern is out of place there.",
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
    this.ended = () => {
      this.send = () => {};
      this.onstate("ended", "");
    };
  }

  open() {
    this.model.on("msg:custom", this.received);
    this.model.on("comm_live_update", this.ended); // as JupyterLab starts the kernel anew
    this.onstate("open", "");
  }

  send(message, buffers = []) {
    this.model.send(message, undefined, buffers);
  }

  close() {
    this.model.off("msg:custom", this.received);
    this.model.off("comm_live_update", this.ended);
  }
}

/** A recorded session, which the documentation plays without a server; docs/recorded.py makes one. */
class Recording {
  constructor(text) {
    this.text = text;
    [this.layer, this.at] = ["picture", "null"];
    this.onmessage = this.onstate = () => {};
  }

  async open() {
    const packed = Uint8Array.from(atob(this.text), (one) => one.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    const end = bytes.indexOf(0);
    this.recorded = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)));
    this.bytes = bytes.subarray(end + 1);
    this.onstate("open", "");
  }

  emit([message, places]) {
    const buffers = places.map(([begin, size]) => this.bytes.subarray(begin, begin + size));
    setTimeout(() => this.onmessage(message, buffers));
  }

  send(message) {
    const { start, inside, moments, frames, explained, reasons, pixels } = this.recorded;
    const frame = () => this.emit(frames[`${this.layer} ${this.at}`] ?? frames[`picture ${this.at}`]);
    if (message.kind === "hello") start.forEach((one) => this.emit(one));
    else if (message.kind === "inside" && message.open) this.emit(inside);
    else if (message.kind === "schedules") this.recorded.films.forEach((one) => this.emit(one));
    else if (message.kind === "view") {
      this.layer = message.layer;
      frame();
    } else if (message.kind === "seek") {
      const { level, sweep, sets } = message;
      const own = moments.filter(([, found]) => found && found[0] === level && found[1] === sweep);
      const near = own.sort((one, other) => Math.abs(one[1][2] - sets) - Math.abs(other[1][2] - sets))[0];
      this.at = near ? near[0] : "null";
      this.emit([{ kind: "moments", moments: [near ? JSON.parse(near[0]) : null] }, []]);
      frame();
    } else if (message.kind === "explain") {
      const far = ([row, col]) => Math.hypot(row - message.row, col - message.col);
      const [near] = [...pixels].sort((one, other) => far(one) - far(other));
      this.emit([reasons[explained[`${near} ${this.at}`]], []]);
    }
  }

  close() {}
}

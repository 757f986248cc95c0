// Hold-to-run: `hold`, a button, and `joystick`.
import { enteredValues } from "../entries.js";
import { closest, find, needsPerson, setText, showOutcome } from "../show.js";

// Where a button is while it is held: whatever changes the page under the finger ends the hold.

const MOST_PX = 1; // that it may move by rounding

class HoldPlace {
  #button;
  #box;
  #point;

  // `point` is where a pointer went down on it, null for a key.
  /** @param {HTMLElement} button @param {{ clientX: number, clientY: number } | null} point */
  constructor(button, point) {
    this.#button = button;
    this.#box = button.getBoundingClientRect();
    this.#point = point;
  }

  // Whether the button is where it was, and nothing lies over it at the finger.
  get isKept() {
    const box = this.#button.getBoundingClientRect();
    if (!box.width || !box.height) return false;
    for (const side of /** @type {const} */ (["left", "top", "right", "bottom"]))
      if (Math.abs(box[side] - this.#box[side]) > MOST_PX) return false;
    if (!this.#point) return true;
    const top = document.elementFromPoint(this.#point.clientX, this.#point.clientY);
    return closest(top, "button") === this.#button;
  }
}

// Calls `changed` when the part of the page that the screen shows, or the button's box, changes.
/** @param {HTMLElement} button @param {() => void} changed */
function watchPlace(button, changed) {
  for (const name of ["resize", "scroll"]) visualViewport?.addEventListener(name, changed);
  new ResizeObserver(changed).observe(button);
}

// The confirmation of the next hold by a person, where the hold needs one. The hold is the touch after it.

class HoldProof {
  #root;
  #show;
  #confirmation = "";

  /** @param {HTMLElement} root @param {(outcome: string, reason: string) => void} show */
  constructor(root, show) {
    this.#root = root;
    this.#show = show;
  }

  // Whether the touch has to be confirmed before it can hold.
  get isMissing() {
    return needsPerson(this.#root) && !this.#confirmation;
  }

  // What the begin of a hold has of it; it is used up.
  take() {
    const proof = this.#confirmation ? { confirmation: this.#confirmation } : {};
    this.#confirmation = "";
    return proof;
  }

  async ask() {
    const { confirmByPerson } = await import("../confirm-person.js");
    await confirmByPerson(this.#root, enteredValues(), (_, proof) => this.#keep(proof), null);
  }

  /** @param {import("../confirm-person.js").Proof} proof */
  #keep({ confirmation, valid_s, reason }) {
    this.#confirmation = confirmation;
    this.#show("confirmed", reason);
    setTimeout(() => {
      if (this.#confirmation !== confirmation) return;
      this.#confirmation = "";
      this.#show("", "");
    }, 1000 * valid_s);
  }
}

// What both have in common: it acts while it is held. Every event that may mean a release ends the hold, and
// only a new press starts another one. The page shows the server's response, nothing else.

// On the page's own thread on purpose: a page that stalls must not keep a hold alive.
const BEAT_MS = 80;
// Without a response for so long the server has ended the hold.
const SILENCE_MS = 500;
// The last response waits for the disk.
const LAST_RESPONSE_MS = 3000;
class Holding {
  root;
  button;
  /** @type {PageSource} */
  #source;
  #proof;
  /** @type {WebSocket | null} */
  #socket = null; // of the current hold; null without one
  #lease = "";
  #stamp = 0; // the server's last stamp, and when it arrived
  #stampedAt = 0;
  #number = 0;
  #timer = 0;
  /** @type {number | null} */
  pointer = null; // the pointer or the key that holds it
  /** @type {string | null} */
  key = null;
  /** @type {HoldPlace | null} */
  #place = null; // of the current hold
  /** @type {Map<WebSocket, string>} */
  #ending = new Map(); // socket → reason, of ended holds without their last response

  /** @param {HTMLElement} root @param {PageSource} source */
  constructor(root, source) {
    this.root = root;
    this.button = find(root, "button.hold");
    this.#source = source;
    this.#proof = new HoldProof(root, (outcome, reason) => this.#show(outcome, reason));
    // A long touch must not open a menu; pointer events arrive all the same.
    this.button.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    this.button.addEventListener("dragstart", (event) => event.preventDefault());
    listenForEnd(
      this.button,
      () => this.pointer,
      () => this.key,
      (why) => this.end(why),
    );
    watchPlace(this.button, () => this.#place?.isKept === false && this.end("moved"));
    addEventListener("resize", () => this.end("moved"));
  }

  // What each heartbeat has in it; a joystick has its deflection.
  /** @returns {object} */
  heartbeatData() {
    return {};
  }

  // The server's response to a heartbeat: the texts of what it has sent to the robot.
  /** @param {Record<string, string>} _moves */
  onResponse(_moves) {}

  // The hold has ended.
  onEnd() {}

  get busy() {
    return this.#socket !== null || this.button.disabled || document.hidden;
  }

  get isHeld() {
    return this.#socket !== null;
  }

  // `point` is where a pointer went down, null for a key.
  /** @param {{ clientX: number, clientY: number } | null} point */
  begin(point = null) {
    if (this.#proof.isMissing) {
      this.pointer = this.key = null;
      return void this.#proof.ask();
    }
    const proof = this.#proof.take();
    this.#place = new HoldPlace(this.button, point);
    this.root.dataset.hold = "asked";
    this.#show("", "");
    this.#lease = "";
    this.#number = 0;
    const { base, embed } = pageGuard.page;
    const path = `${base}/widgets/${this.root.dataset.widget}/hold${embed}`;
    const socket = new WebSocket(new URL(path, location.href).href.replace(/^http/, "ws"));
    this.#socket = socket;
    this.#stampedAt = performance.now();
    let begun = false;
    socket.onmessage = ({ data }) => {
      const isCurrent = socket === this.#socket;
      if (!isCurrent && !this.#ending.has(socket)) return;
      const message = JSON.parse(data);
      this.#stamp = message.stamp;
      this.#stampedAt = performance.now();
      const begin = { do: "begin", inputs: enteredValues(), seen: this.#source.seen, ...proof };
      if (!begun && isCurrent) this.#send(socket, begin);
      else if (!begun) this.#send(socket, { do: "end", why: this.#ending.get(socket) });
      begun = true;
      if (message.state === "held") isCurrent && this.#held(socket, message);
      else if (message.state) this.#ended(socket, message);
    };
    socket.onclose = () => this.#lost(socket);
    this.#timer = setInterval(() => this.beat(socket), BEAT_MS);
  }

  /** @param {WebSocket | null} socket @param {object} message */
  #send(socket, message) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    socket.send(JSON.stringify({ ...message, stamp: this.#stamp, after: performance.now() - this.#stampedAt }));
  }

  // Between the regular ones too, where there is news.
  beat(socket = this.#socket) {
    if (this.#place?.isKept === false) this.end("moved");
    else if (performance.now() - this.#stampedAt > SILENCE_MS) this.end("silence");
    else if (this.#lease)
      this.#send(socket, { do: "beat", number: ++this.#number, lease: this.#lease, ...this.heartbeatData() });
  }

  /** @param {WebSocket} socket @param {{ lease?: string, moves?: Record<string, string> }} message */
  #held(socket, { lease, moves }) {
    if (moves) this.onResponse(moves);
    if (!lease) return;
    this.#lease = lease;
    this.beat(socket); // on a slow network the next one may be too late
    this.root.dataset.hold = "held";
    this.button.setAttribute("aria-pressed", "true");
  }

  // Ends the hold on this page at once; the server's response is shown after.
  /** @param {string} why */
  end(why) {
    const socket = this.#socket;
    if (!socket) return;
    this.#reset();
    this.#send(socket, { do: "end", why, lease: this.#lease });
    if (why === "silence" || why === "leaving") {
      socket.close();
      if (why === "silence") this.#show("unknown", this.root.dataset.cut);
    } else {
      this.#ending.set(socket, why);
      setTimeout(() => socket.close(), LAST_RESPONSE_MS);
    }
  }

  /** @param {WebSocket} socket @param {Receipt} message */
  #ended(socket, { outcome, reason }) {
    this.#ending.delete(socket);
    if (socket === this.#socket) this.#reset();
    else if (this.#socket) return;
    this.#show(outcome, reason);
    socket.close();
  }

  /** @param {WebSocket} socket */
  #lost(socket) {
    const unanswered = this.#ending.delete(socket);
    if (socket === this.#socket) this.#reset();
    else if (!unanswered || this.#socket) return;
    this.#show("unknown", this.root.dataset.cut);
  }

  #reset() {
    clearInterval(this.#timer);
    this.#socket = this.pointer = this.key = this.#place = null;
    delete this.root.dataset.hold;
    this.button.setAttribute("aria-pressed", "false");
    this.onEnd();
  }

  /** @param {string} outcome @param {string | undefined} reason */
  #show(outcome, reason) {
    showOutcome(find(this.root, ".receipt"), outcome, reason);
  }
}

// The events that end a hold.
// Calls `end(why)`. `pointer` and `key` return the pointer id and the key that hold the button, or null.
/** @param {HTMLButtonElement} button @param {() => number | null} pointer @param {() => string | null} key @param {(why: string) => void} end */
function listenForEnd(button, pointer, key, end) {
  /** @template {keyof WindowEventMap} K @param {EventTarget} target @param {K} name @param {(event: WindowEventMap[K]) => void} listener */
  const on = (target, name, listener) => target.addEventListener(name, listener, { capture: true });
  button.addEventListener("pointerleave", (event) => event.pointerId === pointer() && end("sliding"));
  button.addEventListener("contextmenu", (event) => {
    event.preventDefault();
    end("menu");
  });
  button.addEventListener("blur", () => end("blur"));
  on(window, "pointerdown", (event) => event.pointerId !== pointer() && end("second"));
  on(window, "pointerup", (event) => event.pointerId === pointer() && end("released"));
  on(window, "pointercancel", (event) => event.pointerId === pointer() && end("cancel"));
  on(window, "keyup", (event) => event.key === key() && end("released"));
  on(window, "keydown", (event) => event.key === "Escape" && end("escape"));
  on(window, "blur", (event) => event.target === window && end("blur"));
  on(document, "visibilitychange", () => document.hidden && end("hiding"));
  on(window, "pagehide", () => end("leaving"));
  // A lock, or the loss of the event stream, which locks all.
  new MutationObserver(() => button.disabled && end("lock")).observe(button, { attributeFilter: ["disabled"] });
}

// A hold: a button, by a finger, a mouse button, Space or Enter.

const KEYS = [" ", "Enter"];

class Hold extends Holding {
  #seconds = new Intl.NumberFormat(document.documentElement.lang, { minimumFractionDigits: 1 });
  #since = 0; // of this page's own hold, by performance.now(); 0 without one

  /** @param {HTMLElement} root @param {PageSource} source */
  constructor(root, source) {
    super(root, source);
    this.button.addEventListener("pointerdown", (event) => this.#down(event));
    this.button.addEventListener("keydown", (event) => this.#keyDown(event));
  }

  // For how long it is held, in half seconds.
  /** @param {WebSocket | null} [socket] */
  beat(socket) {
    super.beat(socket);
    if (this.root.dataset.hold !== "held") return;
    this.#since ||= performance.now();
    const halves = Math.floor((performance.now() - this.#since) / 500);
    setText(find(this.root, ".held-for"), `${this.#seconds.format(halves / 2)} s`);
  }

  onEnd() {
    this.#since = 0;
    setText(find(this.root, ".held-for"), "");
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.button !== 0 || this.busy) return;
    // A finger's pointer stays with the button by itself: it must be seen to slide off.
    if (this.button.hasPointerCapture(event.pointerId)) this.button.releasePointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.begin(event);
  }

  /** @param {KeyboardEvent} event */
  #keyDown(event) {
    if (!KEYS.includes(event.key)) return;
    event.preventDefault();
    if (event.repeat || this.busy) return;
    this.key = event.key;
    this.begin();
  }
}

// A joystick: a hold whose heartbeats have the deflection. It follows one finger, wherever that goes, and shows the
// values that the server has sent to the robot.

const APART_MS = 40; // between two heartbeats of a finger that moves
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };

class Joystick extends Holding {
  /** @type {HTMLElement} */
  #knob;
  #x = 0;
  #y = 0;
  /** @type {Set<string>} */
  #arrows = new Set(); // those that are held
  #beatAt = 0;

  /** @param {HTMLElement} root @param {PageSource} source */
  constructor(root, source) {
    super(root, source);
    this.#knob = find(root, ".knob");
    this.button.addEventListener("pointerdown", (event) => this.#down(event));
    this.button.addEventListener("pointermove", (event) => event.pointerId === this.pointer && this.#moveTo(event));
    this.button.addEventListener("keydown", (event) => this.#keyDown(event));
    window.addEventListener("keyup", (event) => this.#keyUp(event), { capture: true });
    if (root.dataset.gamepad) new GamepadStick(this, root.dataset.gamepad);
  }

  heartbeatData() {
    return { x: this.#x, y: this.#y };
  }

  /** @param {Record<string, string>} moves */
  onResponse(moves) {
    for (const [axis, text] of Object.entries(moves)) find(this.root, `[data-axis="${axis}"]`).textContent = text;
  }

  onEnd() {
    this.#arrows.clear();
    this.#deflect(0, 0);
    for (const value of this.root.querySelectorAll("[data-axis]")) value.textContent = "";
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.button !== 0 || this.busy) return;
    this.button.setPointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.begin(event);
    this.#moveTo(event);
  }

  // From the middle of the pad, as far as the knob goes.
  /** @param {PointerEvent} event */
  #moveTo({ clientX, clientY }) {
    const { left, top, width, height } = find(this.root, ".pad").getBoundingClientRect();
    const reach = (Math.min(width, height) - this.#knob.offsetWidth) / 2;
    this.deflect((clientX - left - width / 2) / reach, (top + height / 2 - clientY) / reach);
  }

  // Moves the knob, and says so in the next heartbeat, which comes sooner for it.
  /** @param {number} x @param {number} y */
  deflect(x, y) {
    const before = [this.#x, this.#y];
    this.#deflect(x, y);
    const isSame = before[0] === this.#x && before[1] === this.#y;
    if (isSame || performance.now() - this.#beatAt < APART_MS) return;
    this.#beatAt = performance.now();
    this.beat();
  }

  /** @param {number} x @param {number} y */
  #deflect(x, y) {
    /** @param {number} value */
    const inside = (value) => Math.max(-1, Math.min(1, value));
    const far = this.root.dataset.shape === "circle" ? Math.max(1, Math.hypot(x, y)) : 1;
    this.#x = inside(x / far);
    this.#y = inside(y / far);
    this.#knob.style.setProperty("--x", String(this.#x));
    this.#knob.style.setProperty("--y", String(this.#y));
  }

  /** @param {KeyboardEvent} event */
  #keyDown(event) {
    if (!(event.key in ARROWS)) return;
    event.preventDefault();
    if (event.repeat || this.pointer !== null) return;
    if (!this.isHeld) {
      if (this.busy) return;
      this.begin();
    }
    this.#arrows.add(event.key);
    this.#deflectByArrows();
  }

  /** @param {KeyboardEvent} event */
  #keyUp(event) {
    if (!this.#arrows.delete(event.key)) return;
    if (this.#arrows.size) this.#deflectByArrows();
    else this.end("released");
  }

  #deflectByArrows() {
    const held = [...this.#arrows].map((key) => ARROWS[key]);
    /** @param {0 | 1} axis */
    const sum = (axis) => held.reduce((all, arrow) => all + arrow[axis], 0);
    this.#deflect(sum(0), sum(1));
    this.beat();
  }
}

// A gamepad moves a joystick while its grip key is held, the one above the stick. Only a new press of that key begins
// a hold: not one from before a lock, a page or the focus of another window.

const LOOK_MS = 20; // between two looks at a gamepad: browsers tell of no change
/** @type {Record<string, { axes: [number, number], grip: number }>} */
const STICKS = { left: { axes: [0, 1], grip: 4 }, right: { axes: [2, 3], grip: 5 } }; // of the standard mapping

class GamepadStick {
  #joystick;
  #stick;
  #timer = 0;
  /** @type {number | null} */
  #holder = null; // the gamepad whose grip key has begun the hold
  /** @type {Map<number, boolean>} */
  #grips = new Map(); // gamepad → whether its grip key was down at the last look

  /** @param {Joystick} joystick @param {string} side */
  constructor(joystick, side) {
    this.#joystick = joystick;
    this.#stick = STICKS[side];
    for (const name of ["gamepadconnected", "gamepaddisconnected"]) addEventListener(name, () => this.#changed());
    this.#changed();
  }

  get #pads() {
    return navigator.getGamepads().filter((pad) => pad?.connected);
  }

  // Looks while there is a gamepad.
  #changed() {
    const pads = this.#pads;
    clearInterval(this.#timer);
    if (pads.length) this.#timer = setInterval(() => this.#look(), LOOK_MS);
    else this.#look();
    const { root } = this.#joystick;
    const isKnown = pads.some((pad) => pad?.mapping === "standard");
    find(root, ".gamepad-known").hidden = !isKnown;
    find(root, ".gamepad-unknown").hidden = isKnown || !pads.length;
  }

  #look() {
    const joystick = this.#joystick;
    const pads = this.#pads.filter((pad) => pad?.mapping === "standard");
    if (!joystick.isHeld) this.#holder = null; // ended by something else
    if (this.#holder !== null && !pads.some((pad) => pad?.index === this.#holder)) joystick.end("gamepad");
    const before = this.#grips;
    this.#grips = new Map();
    for (const pad of pads) {
      if (!pad) continue;
      const isDown = pad.buttons[this.#stick.grip]?.pressed === true;
      this.#grips.set(pad.index, isDown || !document.hasFocus());
      if (this.#holder === pad.index) this.#follow(pad, isDown);
      else if (isDown && before.get(pad.index) === false) this.#begin(pad);
    }
  }

  /** @param {Gamepad} pad */
  #begin(pad) {
    const joystick = this.#joystick;
    if (!document.hasFocus() || joystick.isHeld || joystick.busy) return;
    if (!joystick.button.checkVisibility()) return; // its group is not the one shown
    joystick.begin();
    if (!joystick.isHeld) return; // a person has to confirm first
    this.#holder = pad.index;
    this.#follow(pad, true);
  }

  /** @param {Gamepad} pad @param {boolean} isDown */
  #follow(pad, isDown) {
    const [right, back] = this.#stick.axes.map((axis) => pad.axes[axis]);
    if (!isDown) this.#joystick.end("released");
    else if (!Number.isFinite(right) || !Number.isFinite(back)) this.#joystick.end("gamepad");
    else this.#joystick.deflect(right, -back);
  }
}

/** @type {Hooks} */
export const hold = { equip: (root, source) => new Hold(root, source) };
/** @type {Hooks} */
export const joystick = { equip: (root, source) => new Joystick(root, source) };

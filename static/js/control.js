// Control of the robot: the bar that shows its holder, the lock in all other browsers, and the holder's
// keep-alive. Loaded only where the panel requires control.
import { setText } from "./show.js";

const TAP_AGAIN_MS = 700; // as in press.js
const RESPONSE_TIMEOUT_MS = 5000;
const BEATS_PER_KEEP_ALIVE = 3; // two heartbeats a second; the server releases a holder after 5 s of silence
const TOUCH_INTERVAL_MS = 1000;
const LOCK = { enabled: false, more: "" }; // besides its reasons
const TEXT = { asking: "asker_text", holding: "holder_text", asked: "holder_text" };

export class Control {
  #bar;
  #locks = new Map(); // widget id → the server's attributes of its lock
  #state = null;
  #linkOk = true;
  #beats = 0;
  #touchedAt = -Infinity;
  #to = ""; // the asker when the finger went down
  #busy = false;
  #showWidget;
  #timeOf;

  // `showWidget` takes (widget id, attributes) of a changed lock; `timeOf` returns the server's time of an event.
  constructor(bar, showWidget, timeOf) {
    this.#bar = bar;
    this.#timeOf = timeOf;
    this.#showWidget = showWidget;
    for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => this.#touch(), true);
    this.#bar.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#act(event.submitter, this.#timeOf(event));
    });
  }

  get #role() {
    const { holder, asker } = this.#state;
    const { me, over } = this.#bar.dataset;
    if (!holder) return "free";
    if (me === holder) return asker ? "asked" : "holding";
    if (me && me === asker) return "asking";
    return over === undefined ? "held" : "over";
  }

  get #isHolder() {
    return this.#state && ["holding", "asked"].includes(this.#role);
  }

  show(state) {
    this.#state = state;
    setText(this.#bar.querySelector(".refused"), "");
    this.#draw();
  }

  // The id of this browser, from the stream: the page may have been requested without its cookie.
  browser({ id }) {
    if (this.#bar.dataset.me === id) return;
    this.#bar.dataset.me = id;
    if (this.#state) this.#draw();
  }

  link(lamps) {
    this.#linkOk = lamps.bridge.state === "ok";
    this.#updateLocks();
  }

  lost() {
    this.#state = null;
    this.#locks.clear();
    this.#bar.querySelector(".who").textContent = document.body.dataset.unknown;
    for (const button of this.#bar.querySelectorAll("button")) button.disabled = true;
  }

  // The attributes as this page shows them. A lost link goes before a lack of control.
  over(id, attributes) {
    if (!("enabled" in attributes || this.#locks.has(id))) return attributes;
    const lock = Object.entries({ ...this.#locks.get(id), ...attributes }).filter(([name]) => name in LOCK || name.startsWith("reason"));
    this.#locks.set(id, Object.fromEntries(lock));
    return { ...attributes, ...this.#locked(this.#locks.get(id)) };
  }

  beat() {
    if (!this.#state || !["holding", "asked", "asking"].includes(this.#role)) return;
    this.#beats += 1;
    if (this.#beats >= BEATS_PER_KEEP_ALIVE) this.#keepAlive(false);
  }

  #locked(lock) {
    if (this.#isHolder || !this.#state || !this.#linkOk) return lock;
    return Object.fromEntries(Object.keys(lock).map((name) => [name, LOCK[name] ?? this.#state.text]));
  }

  #updateLocks() {
    for (const [id, lock] of this.#locks) this.#showWidget(id, lock);
  }

  #draw() {
    const role = this.#role;
    this.#bar.dataset.role = role;
    this.#bar.elements.to.value = this.#state.asker;
    setText(this.#bar.querySelector(".who"), this.#state[TEXT[role] ?? "text"]);
    for (const button of this.#bar.querySelectorAll("button")) {
      button.hidden = !button.dataset.roles.split(" ").includes(role);
      button.disabled = false;
    }
    this.#updateLocks();
  }

  #touch() {
    this.#to = this.#bar.elements.to.value;
    const now = performance.now();
    if (!this.#isHolder || now - this.#touchedAt < TOUCH_INTERVAL_MS) return;
    this.#touchedAt = now;
    this.#keepAlive(true);
  }

  #keepAlive(touched) {
    this.#beats = 0;
    this.#post("here", { touched }, true).catch(() => {}); // the next one may succeed
  }

  // A second tap is the same action: it must not press the button that replaces this one.
  async #act(button, at) {
    if (this.#busy || button.disabled) return;
    this.#busy = true;
    this.#bar.setAttribute("aria-busy", "true");
    const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
    const refusal = this.#bar.querySelector(".refused");
    try {
      const action = button.getAttribute("formaction").split("/").at(-1);
      const response = await (await this.#post(action, { to: this.#to, at })).json();
      refusal.textContent = response.reason ?? response.error;
    } catch {
      refusal.textContent = document.body.dataset.unsure;
    }
    await pause;
    this.#busy = false;
    this.#bar.removeAttribute("aria-busy");
  }

  #post(action, body, keepalive = false) {
    return fetch(`${document.body.dataset.base}/control/${action}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
      signal: AbortSignal.timeout(RESPONSE_TIMEOUT_MS),
      keepalive,
    });
  }
}

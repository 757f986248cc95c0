// Who has control of the robot: the bar that says so, the lock on every button of who has not, and
// the holder's sign of life. Loaded only where the panel requires control.
const TAP_AGAIN_MS = 700;
const ANSWER_WITHIN_MS = 5000;
const BEATS_PER_SIGN = 3; // the server beats twice a second, and gives up who is silent for 5 s
const TOUCH_AGAIN_MS = 1000;
const LOCK = { enabled: false, more: "" }; // and its reasons
const TEXT = { asking: "asker_text", holding: "holder_text", asked: "holder_text" };

export class Control {
  #bar;
  #said = new Map(); // what the server says of each button, whoever has control
  #state = null;
  #passable = true;
  #beats = 0;
  #touchedAt = -Infinity;
  #to = ""; // who asked when the finger went down
  #busy = false;
  #showAgain;
  #timeOf;

  // `showAgain` gets (widget id, attributes) where a lock has changed; `timeOf` gives the server's own
  // time of an event.
  constructor(bar, showAgain, timeOf) {
    this.#bar = bar;
    this.#timeOf = timeOf;
    this.#showAgain = showAgain;
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

  get #mine() {
    return this.#state && ["holding", "asked"].includes(this.#role);
  }

  show(state) {
    this.#state = state;
    this.#bar.querySelector(".refused").textContent = "";
    this.#draw();
  }

  // The id of this browser, from the stream: the page may have been loaded without its cookie.
  browser({ id }) {
    if (this.#bar.dataset.me === id) return;
    this.#bar.dataset.me = id;
    if (this.#state) this.#draw();
  }

  link(lamps) {
    this.#passable = lamps.bridge.state === "ok";
    this.#lockAgain();
  }

  lost() {
    this.#state = null;
    this.#said.clear();
    this.#bar.querySelector(".who").textContent = document.body.dataset.unknown;
    for (const button of this.#bar.querySelectorAll("button")) button.disabled = true;
  }

  // The attributes as this page shows them. A lost link is told before who has control.
  over(id, attributes) {
    if (!("enabled" in attributes || this.#said.has(id))) return attributes;
    const all = { ...this.#said.get(id), ...attributes };
    const said = Object.entries(all).filter(([name]) => name in LOCK || name.startsWith("reason"));
    this.#said.set(id, Object.fromEntries(said));
    return { ...attributes, ...this.#locked(this.#said.get(id)) };
  }

  beat() {
    if (!this.#state || !["holding", "asked", "asking"].includes(this.#role)) return;
    this.#beats += 1;
    if (this.#beats >= BEATS_PER_SIGN) this.#sign(false);
  }

  #locked(said) {
    if (this.#mine || !this.#state || !this.#passable) return said;
    const told = Object.keys(said).map((name) => [name, LOCK[name] ?? this.#state.text]);
    return Object.fromEntries(told);
  }

  #lockAgain() {
    for (const [id, said] of this.#said) this.#showAgain(id, said);
  }

  #draw() {
    const role = this.#role;
    this.#bar.dataset.role = role;
    this.#bar.elements.to.value = this.#state.asker;
    const who = this.#bar.querySelector(".who");
    const text = this.#state[TEXT[role] ?? "text"];
    if (who.textContent !== text) who.textContent = text;
    for (const button of this.#bar.querySelectorAll("button")) {
      button.hidden = !button.dataset.roles.split(" ").includes(role);
      button.disabled = false;
    }
    this.#lockAgain();
  }

  #touch() {
    this.#to = this.#bar.elements.to.value;
    const now = performance.now();
    if (!this.#mine || now - this.#touchedAt < TOUCH_AGAIN_MS) return;
    this.#touchedAt = now;
    this.#sign(true);
  }

  #sign(touched) {
    this.#beats = 0;
    this.#post("here", { touched }, true).catch(() => {}); // the next one may get through
  }

  // A second tap is the same act: it must not meet the button that came in its place.
  async #act(button, at) {
    if (this.#busy || button.disabled) return;
    this.#busy = true;
    this.#bar.setAttribute("aria-busy", "true");
    const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
    const said = this.#bar.querySelector(".refused");
    try {
      const act = button.getAttribute("formaction").split("/").at(-1);
      const answer = await (await this.#post(act, { to: this.#to, at })).json();
      said.textContent = answer.reason ?? answer.error;
    } catch {
      said.textContent = document.body.dataset.unsure;
    }
    await pause;
    this.#busy = false;
    this.#bar.removeAttribute("aria-busy");
  }

  #post(act, body, keepalive = false) {
    return fetch(`${document.body.dataset.base}/control/${act}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
      signal: AbortSignal.timeout(ANSWER_WITHIN_MS),
      keepalive,
    });
  }
}

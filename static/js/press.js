// A press: on release, once, with an id of its own; its receipt is shown where it was pressed.
const ANSWER_WITHIN_MS = 5000;
// Two taps of a finger come within this time: the second one is the same press.
export const TAP_AGAIN_MS = 700;
// A page that nobody touches for so long gives its socket back.
const UNTOUCHED_MS = 60_000;

export function newId() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// With its type. What is no number (an empty field), or a whole one that is not exact here, goes as it
// is written: the server says what is wrong.
function valueOf(input) {
  if (input.type === "checkbox") return input.checked;
  const number = input.type === "number" || input.type === "range";
  if (!number || input.value === "") return input.value;
  const value = Number(input.value);
  return Number.isInteger(value) && !Number.isSafeInteger(value) ? input.value : value;
}

// They stay in place: none comes or goes while the page is there.
const entries = [...document.querySelectorAll("[data-widget] :is(input:not([type=hidden]), select)")];

// All that is entered on the page, by the names of the inputs.
export function entered() {
  return Object.fromEntries(entries.map((input) => [input.name, valueOf(input)]));
}

// The input of a parameter: it shows the robot's value until it is touched, and then what was entered
// until that is set.
const touched = new WeakSet();
const said = new WeakMap(); // what the robot said since the last press

function entryOf(root) {
  return root.querySelector("[data-entry]");
}

export function showEntry(root, value) {
  const input = entryOf(root);
  said.set(input, value);
  if (touched.has(input)) return;
  if (input.type === "checkbox") input.checked = value === true;
  else if (input.value !== value) input.value = value;
}

// What was entered is set: the input follows the robot again.
function settle(root) {
  const input = entryOf(root);
  if (input) touched.delete(input);
  if (said.has(input)) showEntry(root, said.get(input));
}

export function showBounds(root, bounds) {
  const input = entryOf(root);
  if (input.type !== "number") return;
  Object.assign(input, bounds);
}

addEventListener("input", ({ target }) => target.matches?.("[data-entry]") && touched.add(target));

async function post(url, press, answerMs) {
  const answer = await fetch(url, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(press),
    signal: AbortSignal.timeout(answerMs),
  });
  return { ...(await answer.json()), status: answer.status };
}

export class Presser {
  #line = null;
  #untouched = 0;
  #widgets;
  #sentences;
  #source;
  #underWay = new Set();
  #goal = "";
  #down = null; // the button that was open when the pointer went down on it
  #asked = () => {}; // loaded with the page that asks; until then nothing is pressed
  #seen = null;
  #id = newId(); // of the next press
  #buttons = new Map(); // those that press, with the widgets that they are of

  constructor(widgets, source, sentences) {
    this.#widgets = widgets;
    this.#sentences = sentences;
    this.#source = source;
    if (document.querySelector("dialog.ask")) source.load("./ask.js", ({ asked }) => (this.#asked = asked));
    const down = ({ target }) => {
      this.#down = target.closest?.("button:enabled");
      this.#goal = this.#down?.value; // of a cancel: which one it is for
      this.#seen = source.seen; // what was permitted when the finger came down
      this.#open();
    };
    addEventListener("pointerdown", down, true);
    // A key that is held down is one press.
    const repeated = (event) => event.repeat && event.target.closest?.("button") && event.preventDefault();
    addEventListener("keydown", repeated, true);
    for (const root of widgets.values()) {
      for (const button of root.querySelectorAll("[type=submit]")) this.#buttons.set(button, root);
    }
    for (const form of document.forms) {
      // A click presses at once: a browser takes its time to submit a form.
      const click = (event) => {
        const button = event.target.closest("button");
        // A button that opened under a resting finger was not pressed.
        if (button && event.detail > 0 && button !== this.#down) event.preventDefault();
        else if (this.#buttons.has(button)) this.#pressed(event, button);
      };
      form.addEventListener("click", click, true);
      // By a program, which may ask for it without a click.
      form.addEventListener("submit", (event) => this.#pressed(event, event.submitter));
    }
  }

  // By a pointer, a key or a program: only a pointer has come down before.
  #pressed(event, button) {
    event.preventDefault();
    const root = this.#buttons.get(button);
    if (!root || button.disabled) return;
    // What the robot answers comes with the events.
    if (button.matches(".read")) return void fetch(button.getAttribute("formaction"), { method: "POST" }).catch(() => {});
    const touched = event.detail > 0;
    const click = this.#moment(event, touched ? this.#seen : this.#source.seen);
    const cancel = button.matches(".cancel");
    if (cancel) click.press = touched ? this.#goal : button.value;
    const inputs = entered(); // as they are now: a dialog asks for these, whatever comes meanwhile
    if (cancel || !root.querySelector("dialog.ask")) this.#press(root, button, inputs, click);
    else this.#asked(root, button.form, (yes) => this.#press(root, button, inputs, this.#moment(yes)));
  }

  // What was seen at an event, and when that was, in the server's time.
  #moment(event, seen = this.#source.seen) {
    return { seen, at: this.#source.timeOf(event) };
  }

  // From the touch that may become a press, which takes longer than to open it. Without a socket, and
  // to cancel, a press is posted.
  #open() {
    clearTimeout(this.#untouched);
    this.#untouched = setTimeout(() => this.close(), UNTOUCHED_MS);
    if (!this.#line) import("./line.js").then(({ Line }) => this.#connect(Line), () => {});
  }

  #connect(Line) {
    if (this.#source.streams) this.#line ??= new Line((line) => this.#broke(line));
  }

  // With the event stream, too: what is under way still gets its answer.
  close() {
    this.#line?.leave();
    this.#line = null;
  }

  #broke(line) {
    if (line === this.#line) this.close();
  }

  // A second tap while the first is under way is the same press: it sends nothing.
  async #press(root, button, inputs, click) {
    const url = button.getAttribute("formaction");
    if (this.#underWay.has(url)) return;
    this.#underWay.add(url);
    try {
      const answerMs = ANSWER_WITHIN_MS + 1000 * (root.dataset.answerS ?? 0);
      const line = this.#line?.free && !button.matches(".cancel") ? this.#line : null;
      const answer = this.#send(root.dataset.widget, line, url, { inputs, id: this.#id, ...click }, answerMs);
      // It has left; all that can wait comes after.
      this.#id = newId();
      said.delete(entryOf(root));
      button.setAttribute("aria-busy", "true");
      const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
      this.#show(root, await answer);
      await pause;
    } finally {
      this.#underWay.delete(url);
      button.removeAttribute("aria-busy");
    }
  }

  // Sent once and never again: when no answer comes, it is not known what became of it.
  async #send(widget, line, url, press, answerMs) {
    try {
      const { status, error, ...receipt } = await (line?.ask({ widget, ...press }, answerMs) ?? post(url, press, answerMs));
      if (receipt.outcome) return receipt;
      if (status < 500 && error) return { outcome: "refused", reason: error };
    } catch {
      if (line) this.#broke(line);
    }
    return { outcome: "unknown", reason: this.#sentences.unsure };
  }

  #show(root, { id, outcome, reason }) {
    if (outcome === "succeeded") settle(root);
    for (const other of this.#widgets.values()) {
      const old = other.querySelector(".receipt");
      if (old) {
        old.textContent = "";
        delete old.dataset.outcome;
      }
    }
    // What came of a call is shown to every browser, with the widget's other texts, and corrected
    // there. A cancel's receipt has no id; that it was asked for shows with the goal.
    const shared = id ? outcome !== "refused" : outcome === "accepted";
    if (root.querySelector(".result") && shared) return;
    const receipt = root.querySelector(".receipt");
    receipt.dataset.outcome = outcome;
    receipt.textContent = reason;
  }
}

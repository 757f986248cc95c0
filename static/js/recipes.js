// The page of recipes follows the robot and the other browsers: it is fetched again when the server says that what it
// shows has changed, and put into the page that is there.
import { updateInPlace } from "./in-place.js";
import { addHooks, closest, find } from "./show.js";

const PAUSE_MS = 500; // between two fetches
const LONGEST_MS = 10_000; // for an answer

// Locked until now: no recipe is changed without scripts.
for (const button of document.querySelectorAll("button[data-scripts]")) button.disabled = false;

const main = find(document, "main[data-recipes]");
const load = main.querySelector("[data-kind=recipe]");
let isTouched = false; // under a finger nothing changes
let isStale = false;
let timer = 0;

// What is pressed is the recipe that is on the screen, as it was when the finger went down.
addHooks("recipe", {
  values: (_, value) => ({ [load?.dataset.widget ?? ""]: value }),
  show: { reported: (root, value) => change(root, "reported", value) },
});

addEventListener(
  "pointerdown",
  ({ target }) => {
    isTouched = closest(target, "main[data-recipes]") !== null;
  },
  true,
);
for (const name of ["pointerup", "pointercancel"])
  addEventListener(name, () => {
    isTouched = false;
    if (isStale) refreshSoon();
  });

// Of the event that says how often each set was changed.
/** @param {Record<string, number>} revisions */
export function showRecipes(revisions) {
  change(main, "revision", String(revisions[main.dataset.recipes ?? ""] ?? ""));
}

/** @param {HTMLElement} element @param {string} name @param {string} value */
function change(element, name, value) {
  if (element.dataset[name] === value) return;
  element.dataset[name] = value;
  isStale = true;
  refreshSoon();
}

function refreshSoon() {
  if (timer || main.dataset.mode !== "show") return;
  timer = setTimeout(async () => {
    if (!isTouched) await refresh().catch(() => {}); // the page itself shows that the server is lost
    timer = 0;
    if (isStale && !isTouched) refreshSoon();
  }, PAUSE_MS);
}

async function refresh() {
  isStale = false;
  const answer = await fetch(location.href, {
    headers: { accept: "text/html" },
    signal: AbortSignal.timeout(LONGEST_MS),
  });
  if (!answer.ok) return;
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  const fresh = page.querySelector("main[data-recipes]");
  if (!fresh || isTouched) {
    isStale = true;
    return;
  }
  const wanted = fresh.querySelector("[data-kind=recipe]");
  // The recipe on the page is gone, or there is one now: its button comes with the whole page.
  if (!wanted !== !load) return pageGuard.reload(true);
  updateInPlace(main, fresh, { skips: (element) => element.matches("[data-kind]") });
  if (load && wanted) showLoad(load, wanted);
}

// The button itself stays: its lock comes with the events.
/** @param {HTMLElement} root @param {HTMLElement} wanted */
function showLoad(root, wanted) {
  for (const selector of ["button", ".loads", "a small", ".ask h2", ".ask .changes"]) {
    const [old, fresh] = [root.querySelector(selector), wanted.querySelector(selector)];
    if (!old || !fresh) continue;
    if (old instanceof HTMLButtonElement) old.value = fresh.getAttribute("value") ?? "";
    else updateInPlace(old, fresh);
  }
}

// As spreadsheets write it: UTF-8, UTF-16 with a byte order mark, or Windows-1252. app/cell/recipes/recipe.py has the same.
/** @param {ArrayBuffer} content */
function decoded(content) {
  const [first, second] = new Uint8Array(content);
  if (first === 0xff && second === 0xfe) return new TextDecoder("utf-16le").decode(content);
  if (first === 0xfe && second === 0xff) return new TextDecoder("utf-16be").decode(content);
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(content);
  } catch {
    return new TextDecoder("windows-1252").decode(content);
  }
}

// A file that is chosen is put into the text below it, which is what is sent.
for (const input of document.querySelectorAll("input[data-into]")) {
  input.hidden = false;
  input.addEventListener("change", async () => {
    const text = find(document, "textarea#csv");
    const file = input.files?.[0];
    if (file) text.value = decoded(await file.arrayBuffer());
  });
}

// The user who is signed in: touches put off the sign-out after idle time, which is announced before it comes.
import { find } from "./show.js";

const EVERY_MS = 5000;
const WARNED_S = 30;

const who = find(document, "a.user");
let touched = true;
for (const name of ["pointerdown", "keydown"]) addEventListener(name, () => (touched = true), { passive: true });

async function report() {
  const body = JSON.stringify({ touched });
  touched = false;
  try {
    const headers = { "content-type": "application/json" };
    const answer = await fetch(`${who.dataset.here}`, { method: "POST", headers, body });
    if (!answer.ok) return;
    const session = await answer.json();
    if (session.user !== who.dataset.user) return session.user ? location.reload() : location.assign(who.href);
    warn(session.left_s !== null && session.left_s < WARNED_S, session.ends_by === "longest");
  } catch {
    touched ||= body.includes("true");
  }
}

/**
 * @param {boolean} soon
 * @param {boolean} anyway whatever is touched
 */
function warn(soon, anyway) {
  const note = find(document, "#idle");
  if (soon === note.hidden) note.hidden = !soon;
  const [idle, longest] = note.querySelectorAll("span");
  if (idle && longest) [idle.hidden, longest.hidden] = [anyway, !anyway];
}

if (document.querySelector("form[data-confirm-act], main.sign-in")) import("./signin.js").catch(pageGuard.fail);
if (!document.querySelector("main.sign-in")) followTabs();
// Another tab of this browser may have signed in: the server ends the streams that began before.
function followTabs() {
  const reconnected = () => "cut" in document.body.dataset || void report();
  new MutationObserver(reconnected).observe(document.body, { attributeFilter: ["data-cut"] });
}

if (who.dataset.user) {
  setInterval(() => void report(), EVERY_MS);
  find(document, "#idle").addEventListener("click", () => void report());
}

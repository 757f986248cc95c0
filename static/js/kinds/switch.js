// A switch moves when the robot reports it: the position that it has can't be pressed.
/** @type {Record<string, Show>} */
export const show = {
  at: (root, position) => {
    root.dataset.at = position;
    arrange(root);
  },
};

/** @param {HTMLElement} root @param {boolean} locked */
export function lock(root, locked) {
  root.dataset.enabled = String(!locked);
  arrange(root);
}

/** @param {HTMLElement} root */
function arrange(root) {
  for (const key of root.querySelectorAll("button[data-position]")) {
    const isReported = key.dataset.position === root.dataset.at;
    key.disabled = isReported || root.dataset.enabled === "false";
    key.setAttribute("aria-pressed", String(isReported));
  }
}

// What a key sends: its value when the finger went down.
/** @param {HTMLButtonElement} key @param {string} value */
export const values = (key, value) => ({ [key.name]: value === "true" });

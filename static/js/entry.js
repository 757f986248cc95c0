// The input of a parameter: it shows the robot's value until it is touched, and then what was entered
// until that is set.
const touched = new WeakSet();

function entryOf(root) {
  return root.querySelector("[data-entry]");
}

export function showEntry(root, value) {
  const input = entryOf(root);
  if (touched.has(input)) return;
  if (input.type === "checkbox") input.checked = value === true;
  else if (input.value !== value) input.value = value;
}

// What was entered is set: the input follows the robot again.
export function settle(root) {
  const input = entryOf(root);
  if (input) touched.delete(input);
}

export function showBounds(root, bounds) {
  const input = entryOf(root);
  if (input.type !== "number") return;
  Object.assign(input, bounds);
}

addEventListener("input", ({ target }) => target.matches?.("[data-entry]") && touched.add(target));

// The keys of a step have the values that they publish; one without a value is at the end of the limits.
export const show = {
  step_up: (root, value) => setKey(root, "up", value),
  step_down: (root, value) => setKey(root, "down", value),
};

function setKey(root, way, value) {
  const key = root.querySelector(`[data-way="${way}"]`);
  key.value = value;
  key.toggleAttribute("data-end", !value);
  key.disabled = !value || root.dataset.enabled === "false";
}

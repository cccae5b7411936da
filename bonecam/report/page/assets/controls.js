// Controls of the panel. Each changes `page.state` and calls `changed`.
function slider(id, text, low, high, value, changed) {
  const box = make("div");
  const label = make("p", text);
  const input = document.createElement("input");
  Object.assign(input, { type: "range", id, min: low, max: high, value });
  input.setAttribute("aria-label", text);
  input.addEventListener("input", () => changed(Number(input.value)));
  box.append(label, input);
  return box;
}

function check(id, text, value, changed, colour) {
  const label = make("label");
  const input = document.createElement("input");
  Object.assign(input, { type: "checkbox", id, checked: value });
  input.addEventListener("change", () => changed(input.checked));
  label.append(input, make("span", text));
  if (colour) label.lastChild.style.color = colour;
  return label;
}

function choice(id, text, options, value, changed) {
  const label = make("label");
  const select = document.createElement("select");
  select.id = id;
  for (const [key, name] of options) select.append(new Option(name, key, false, key === value));
  select.addEventListener("change", () => changed(select.value));
  label.append(make("span", text), select);
  return label;
}

function row(...items) {
  const box = make("div", "", "row");
  box.append(...items);
  return box;
}

"use strict";
// Light or dark, as the browser is set or as the button says; paper is always light.
const repaints = [];
const repaint = () => repaints.forEach((draw) => draw());
const theme = document.documentElement.dataset;
const darkness = window.matchMedia("(prefers-color-scheme: dark)");
const isDark = () => (theme.theme ? theme.theme === "dark" : darkness.matches);
let beforePrint = null;

document.getElementById("theme").hidden = false;
document.getElementById("theme").addEventListener("click", () => { theme.theme = isDark() ? "light" : "dark"; repaint(); });
darkness.addEventListener("change", repaint);
window.addEventListener("beforeprint", () => { beforePrint = theme.theme ?? ""; theme.theme = "light"; theme.printing = "yes"; repaint(); });
window.addEventListener("afterprint", () => {
  delete theme.printing;
  if (beforePrint) theme.theme = beforePrint;
  else delete theme.theme;
  repaint();
});

// width and height that Plotly is given: on the screen those of its place, on paper fixed ones, as nothing measures it
const paperSize = (width, height) => (theme.printing ? { width, height } : { autosize: true });

// a branch's colour (#rrggbb) as a line on the page: in the dark halfway to white
const onPage = (colour) => (isDark() ? `#${colour.slice(1).match(/../g).map((part) => ((parseInt(part, 16) + 255) >> 1).toString(16)).join("")}` : colour);

// a colour of the style sheet, as scripts need it that know no variables
function ink(name) {
  const probe = document.createElement("span");
  probe.style.color = `var(--${name})`;
  document.body.append(probe);
  const colour = getComputedStyle(probe).color;
  probe.remove();
  return colour;
}

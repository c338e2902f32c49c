"use strict";
const choice = document.getElementById("step");
function show() {
  for (const part of document.querySelectorAll("[data-step]")) part.hidden = part.dataset.step !== choice.value;
}
if (choice) { choice.addEventListener("change", show); show(); }
document.body.dataset.ready = "yes";

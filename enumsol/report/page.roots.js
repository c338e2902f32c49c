// All solutions at one alpha: a card for each root, with its body.
// a browser keeps about sixteen scenes alive
const CARDS = 6;
const state = { page: 0 };

const drawCards = () => showCards(data.roots, scalesOf(data.roots, data.alpha));

// -- start --------------------------------------------------------------------------------------------------------

function startRoots() {
  byId("bodies").hidden = data.roots.length === 0;
  data.roots.forEach((item, k) => {
    const kind = `index ${signed(item.index)}, ${item.regular ? "regular" : "not regular"}, margin ${short(item.margin)}${item.stability ? `, ${item.stability}` : ""}`;
    Object.assign(item, { key: k, id: `root-${k}`, name: `Root ${k}`, words: kind });
  });
  pageButtons(drawCards);
  for (const row of document.querySelectorAll("tr[data-root]")) {
    const act = () => {
      const number = Number(row.dataset.root);
      if (number >= data.roots.length) return;
      if (Math.floor(number / CARDS) !== state.page) { state.page = Math.floor(number / CARDS); drawCards(); }
      byId(`root-${number}`).scrollIntoView({ block: "center" });
    };
    row.addEventListener("click", act);
    row.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); act(); } });
  }
  if (data.body) prepare(data.roots.filter((item) => item.u));
  lookControls(drawCards);
  byId("marks").append(...bodyKeys(data.roots));
  const more = `The first ${data.roots.length} of ${data.all} roots have a card: the page holds no more. enumsol roots --json writes all.`;
  byId("scale").textContent = scaleWords(scalesOf(data.roots, data.alpha)) + (data.roots.length < data.all ? ` ${more}` : "");
  drawCards();
  document.body.dataset.ready = "yes";
}

if (byId("plotly").textContent) load(startRoots).catch(failed);
else startRoots();

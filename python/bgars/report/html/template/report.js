"use strict";
(() => {
  const page = JSON.parse(document.getElementById("page-data").textContent);
  const table = document.getElementById("balls");
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const rowOf = new Map(rows.map((row) => [row.dataset.ball, row]));
  const marks = new Map([...document.querySelectorAll(".mark")].map((mark) => [mark.dataset.ball, mark]));
  const heads = [...table.tHead.rows[0].cells];
  const panel = document.getElementById("chosen");
  const hint = panel ? [...panel.childNodes].map((node) => node.cloneNode(true)) : [];
  const charts = new Map();
  const reached = (stage) => {
    if (stage in document.documentElement.dataset) return;
    document.documentElement.dataset[stage] = "yes";
    performance.mark(stage);
  };
  let chosen = null;

  // --- choosing a ball: picture, table and charts show the same one ---
  const MOST_CAUSES = 6;
  const addEntry = (list, title, text) => {
    const entry = document.createElement("div");
    const name = document.createElement("dt");
    const value = document.createElement("dd");
    name.textContent = title;
    value.textContent = text;
    entry.append(name, value);
    list.append(entry);
  };
  // The result lies on the page, whole: its budgets are read when a ball is first asked for.
  let measured = null;
  const budgetOf = (ball) => {
    measured ??= JSON.parse(document.getElementById("result").textContent).balls;
    const causes = Object.entries(measured[ball].budget.top_um || {}).slice(0, MOST_CAUSES);
    if (!causes.length) return [];
    const title = document.createElement("h4");
    title.textContent = "U of the height by cause";
    const list = document.createElement("dl");
    for (const [cause, u] of causes) addEntry(list, cause, (2 * u).toFixed(2) + " µm");
    return [title, list];
  };
  const tell = (ball) => {
    if (!panel) return;
    panel.replaceChildren();
    const row = rowOf.get(ball);
    if (!row) return panel.append(...hint.map((node) => node.cloneNode(true)));
    const title = document.createElement("h3");
    title.textContent = row.cells[0].textContent;
    const list = document.createElement("dl");
    heads.slice(1, -1).forEach((head, at) => {
      const text = row.cells[at + 1].textContent;
      addEntry(list, head.textContent, head.dataset.unit && text !== "-" ? `${text} ${head.dataset.unit}` : text);
    });
    const why = document.createElement("p");
    why.textContent = row.cells[row.cells.length - 1].textContent;
    panel.append(title, list, ...budgetOf(ball), why);
  };
  const markAs = (ball, name, on) => {
    for (const node of [rowOf.get(ball), marks.get(ball)]) if (node) node.classList.toggle(name, on);
  };
  const hover = (ball) => {
    document.querySelectorAll(".hover").forEach((node) => node.classList.remove("hover"));
    if (ball !== null) markAs(ball, "hover", true);
    tell(ball === null ? chosen : ball);
  };
  const markedAt = (name) => (chosen !== null && page.places[name][chosen]) || (name === "scene" ? [[], [], []] : [[], []]);
  const mark = () => {
    for (const name of Object.keys(page.places)) {
      const node = charts.get(name);
      const [x, y, z] = markedAt(name);
      if (node) Plotly.restyle(node, z ? { x: [x], y: [y], z: [z] } : { x: [x], y: [y] }, [node.data.length - 1]);
    }
  };
  const choose = (ball, scroll) => {
    if (chosen !== null) markAs(chosen, "chosen", false);
    if (chosen !== null && rowOf.get(chosen)) rowOf.get(chosen).removeAttribute("aria-current");
    chosen = rowOf.has(ball) ? ball : null;
    if (chosen !== null) {
      markAs(chosen, "chosen", true);
      const row = rowOf.get(chosen);
      row.setAttribute("aria-current", "true");
      if (row.hidden) { document.getElementById("filter").value = ""; press("all"); }
      if (scroll) {
        const frame = table.closest(".scroll");
        frame.scrollTop += row.getBoundingClientRect().top - frame.getBoundingClientRect().top - frame.clientHeight / 2;
      }
    }
    tell(chosen);
    mark();
  };
  for (const [nodes, scroll] of [[rowOf, false], [marks, true]]) {
    for (const [ball, node] of nodes) {
      node.addEventListener("pointerenter", () => hover(ball));
      node.addEventListener("pointerleave", () => hover(null));
      node.addEventListener("click", () => choose(chosen === ball ? null : ball, scroll));
    }
  }
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") choose(null, false); });

  const bare = document.getElementById("bare");
  if (bare) bare.addEventListener("click", () => {
    bare.setAttribute("aria-pressed", String(document.getElementById("picture").classList.toggle("bare")));
  });

  // --- sorting and filtering ---
  const keyOf = (row, at) => row.cells[at].dataset.value;
  const sortBy = (at) => {
    const head = heads[at];
    const down = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((each) => each.setAttribute("aria-sort", "none"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const isText = at === heads.length - 1;
    const compare = (one, two) => {
      const a = keyOf(one, at), b = keyOf(two, at);
      // What was not measured stays last, whichever way.
      if (a === "" || b === "") return (a === "") - (b === "") || one.dataset.ball - two.dataset.ball;
      const order = isText ? a.localeCompare(b) : Number(a) - Number(b);
      return (down ? -order : order) || one.dataset.ball - two.dataset.ball;
    };
    body.append(...[...rows].sort(compare));
  };
  heads.forEach((head, at) => head.querySelector("button").addEventListener("click", () => sortBy(at)));
  const filters = [...document.querySelectorAll("[data-filter]")];
  const words = document.getElementById("filter");
  const texts = new Map(rows.map((row) => [row, [0, 1, row.cells.length - 1].map((at) => row.cells[at].textContent).join(" ").toLowerCase()]));
  const filter = () => {
    const open = filters.some((each) => each.dataset.filter === "open" && each.getAttribute("aria-pressed") === "true");
    const wanted = words.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const row of rows) {
      const shown = !(open && row.dataset.verdict === "pass") && wanted.every((word) => texts.get(row).includes(word));
      row.hidden = !shown;
      count += shown;
    }
    document.getElementById("shown").textContent = `${count} of ${rows.length} balls`;
  };
  const press = (name) => {
    filters.forEach((each) => each.setAttribute("aria-pressed", String(each.dataset.filter === name)));
    filter();
  };
  filters.forEach((each) => each.addEventListener("click", () => press(each.dataset.filter)));
  words.addEventListener("input", filter);

  // --- charts ---
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const look = (isDark) => {
    const ink = isDark ? "#e8edf2" : "#16202b", grid = isDark ? "#37424e" : "#dfe3e8", strong = isDark ? "#a3afbb" : "#55626f";
    const axis = { gridcolor: grid, zerolinecolor: strong, linecolor: strong, zerolinewidth: 1.5 };
    const axis3d = { gridcolor: grid, zerolinecolor: grid, showbackground: false };
    return { layout: {
      font: { color: ink, family: 'system-ui, "Liberation Sans", Arial, sans-serif', size: 12 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      xaxis: axis, yaxis: axis, scene: { xaxis: axis3d, yaxis: axis3d, zaxis: axis3d }, title: { font: { size: 13 }, x: 0.5 },
      hoverlabel: { bgcolor: isDark ? "#1b222b" : "#ffffff", font: { color: ink } },
    } };
  };
  // Thin marks on a dark page need lighter colours; the 3-D view has its own light.
  const lighter = { "#0072B2": "#56B4E9", "#B0578D": "#E39AC6", "#D55E00": "#FF8A3D" };
  const NAME_PX = 28;
  const thinned = (axis, width) => {
    const step = Math.ceil((axis.tickvals.length * NAME_PX) / Math.max(width - 100, NAME_PX));
    const [tickvals, ticktext] = [axis.tickvals, axis.ticktext].map((all) => all.filter((_, at) => at % step === 0));
    return { ...axis, tickvals, ticktext };
  };
  const shape = (node, isDark, size) => {
    const name = node.dataset.figure;
    let figure = page.figures[name];
    if (isDark && name !== "scene") figure = JSON.parse(JSON.stringify(figure).replace(/#(0072B2|B0578D|D55E00)/g, (color) => lighter[color]));
    const margin = figure.layout.margin || { l: 64, r: 14, t: 40, b: 56 };
    const layout = { ...figure.layout, ...size, margin, template: look(isDark), dragmode: name === "scene" ? "orbit" : false };
    if (layout.xaxis && layout.xaxis.tickvals) layout.xaxis = thinned(layout.xaxis, size.width || node.clientWidth);
    if (!(name in page.places)) return { data: figure.data, layout };
    // The last trace is the mark of the chosen ball.
    const [x, y, z] = markedAt(name);
    return { data: [...figure.data.slice(0, -1), { ...figure.data.at(-1), x, y, ...(z && { z }) }], layout };
  };
  // Named one by one: plotly.js would add a button that sends the chart's data to its makers.
  const VIEW_BUTTONS = [["toImage", "zoom3d", "pan3d", "orbitRotation", "resetCameraDefault3d"]];
  const config = { responsive: false, displaylogo: false, displayModeBar: false, doubleClick: "reset" };
  const ballAt = (event) => {
    const data = event.points && event.points[0] && event.points[0].customdata;
    const index = Array.isArray(data) ? data[0] : data;
    return Number.isInteger(index) ? String(index) : null;
  };
  // plotly.js ends the page, as text: to run it takes longer than all before, and only charts need it.
  const parsed = new Promise((next) => document.addEventListener("DOMContentLoaded", next));
  // Pages of a store share one copy of it, a file beside them.
  let loading = null;
  const library = () => (loading = loading || load());
  const load = async () => {
    const text = document.getElementById("plotly");
    if (!text) return;
    const script = document.createElement("script");
    const { src } = text.dataset;
    if (!src) script.textContent = text.textContent;
    const loaded = src && new Promise((next) => { script.onload = script.onerror = next; });
    if (src) script.src = src;
    text.replaceWith(script);
    if (src) await loaded;
    if (!window.Plotly) document.documentElement.dataset.chartless = "yes";
  };
  const draw = async (node) => {
    await library();
    const name = node.dataset.figure;
    const { data, layout } = shape(node, dark.matches && !printing, printing ? paper(node) : {});
    const drawn = Plotly.newPlot(node, data, layout, name === "scene" ? { ...config, displayModeBar: true, modeBarButtons: VIEW_BUTTONS } : config);
    charts.set(name, node);
    undrawn.delete(node);
    await drawn;
    if (!(name in page.places)) return;
    node.on("plotly_hover", (event) => hover(ballAt(event)));
    node.on("plotly_unhover", () => hover(null));
    node.on("plotly_click", (event) => { const ball = ballAt(event); if (ball !== null) choose(ball, true); });
  };
  const hasWebgl = () => {
    const context = document.createElement("canvas").getContext("webgl");
    return Boolean(context);
  };
  const pause = () => new Promise((next) => setTimeout(next, 0));
  // A chart is drawn when the reader comes within a screen of it, each in a task of its own; near: those whose turn it is.
  const undrawn = new Set(document.querySelectorAll("[data-figure]:not([data-figure=scene])"));
  const near = new Set();
  const offCentre = (node) => {
    const { top, bottom } = node.getBoundingClientRect();
    return Math.abs(top + bottom - innerHeight);
  };
  let drawing = false;
  const drawNear = async () => {
    if (drawing) return;
    drawing = true;
    try {
      while (near.size) {
        await pause();
        await library();
        await pause();
        const [node] = [...near].sort((one, two) => offCentre(one) - offCentre(two));
        near.delete(node);
        if (undrawn.has(node)) await draw(node);
      }
    } finally {
      drawing = false;
    }
    reached("settled");
    if (!undrawn.size) reached("charted");
  };
  const watch = () => {
    if (!undrawn.size || !("IntersectionObserver" in window)) {
      undrawn.forEach((node) => near.add(node));
      return drawNear();
    }
    const watcher = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) near[isIntersecting ? "add" : "delete"](target);
      drawNear();
    }, { rootMargin: "100% 0px" });
    undrawn.forEach((node) => watcher.observe(node));
  };
  // Without a graphics card a 3-D view takes its time: it is drawn when it is asked for, and until then there is a still.
  const opener = document.getElementById("open-scene");
  const openScene = async () => {
    const node = document.querySelector("[data-figure=scene]"), note = document.getElementById("scene-note");
    opener.disabled = true;
    if (!hasWebgl()) {
      note.className = "missing-view";
      note.textContent = "This browser draws no 3-D (WebGL is off). The numbers are in the table of balls.";
      return;
    }
    note.textContent = "drawing ...";
    await parsed;
    await pause();
    await pause();
    page.figures.scene = JSON.parse(document.getElementById("scene-data").textContent);
    node.hidden = false;
    const still = document.getElementById("scene-still");
    if (still) still.hidden = true;
    document.getElementById("scene-keys").hidden = true;
    await draw(node);
    opener.parentElement.hidden = true;
    reached("drawn");
  };
  if (opener) opener.addEventListener("click", openScene);
  const repaint = (isDark, sizeOf) => {
    for (const [name, node] of charts) {
      if (name === "scene") { if (!sizeOf) Plotly.relayout(node, { template: look(isDark), autosize: true }); continue; }
      const { data, layout } = shape(node, isDark, sizeOf ? sizeOf(node) : { autosize: true });
      Plotly.react(node, data, layout);
    }
  };
  const paper = (node) => {
    if (node.parentElement.classList.contains("grid")) return { width: 228, height: 225 };
    return { width: 690, height: node.classList.contains("square") ? 500 : 320 };
  };
  // Paper has sizes of its own: while it is printed, no change of the window or of its colours may undo them.
  let printing = false;
  let waiting = 0;
  dark.addEventListener("change", () => { if (!printing) repaint(dark.matches); });
  window.addEventListener("beforeprint", () => {
    printing = true;
    repaint(false, paper);
    if (document.readyState !== "loading") undrawn.forEach((node) => draw(node));
  });
  window.addEventListener("afterprint", () => { printing = false; repaint(dark.matches); });
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => { if (!printing) repaint(dark.matches); }, 150);
  });
  reached("usable");
  parsed.then(() => requestAnimationFrame(() => setTimeout(watch, 0)));
})();

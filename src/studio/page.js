// Three paints at the corners of a triangle; the point's barycentric coordinates are the weights.
const corners = [[150, 0], [0, 260], [300, 260]];
const wanted = ["polaris_silber", "blue", "ford_f8"];
const at = id => document.getElementById(id);
const state = {
  point: [150, 173], chosen: [],
  // What the pictures are of: an answered blend and the names of its paints, which belong together.
  blend: null, names: [], asked: 0,
  // The picture that is being waited for, and what to draw after it.
  drawing: null, again: null, rest: 0,
};

const problemOf = async answer => {
  try { const told = await answer.json(); return told.detail || told.title; } catch { return `${answer.status}`; }
};

async function ask(address, options) {
  const answer = await fetch(address, options);
  if (!answer.ok) throw new Error(await problemOf(answer));
  return answer;
}

async function whenDone(answer) {
  while (answer.status === 202) {
    const job = await (await ask(answer.headers.get("location"))).json();
    if (job.state === "failed" || job.state === "cancelled") throw new Error(job.problem?.detail || job.state);
    if (job.state === "done") return (await ask(job.result)).json();
    at("caption").textContent = `${job.stage || "waiting"} ${Math.round(100 * (job.progress || 0))} %`;
    await new Promise(wake => setTimeout(wake, 300));
  }
  return answer.json();
}

function weights() {
  const [[ax, ay], [bx, by], [cx, cy]] = corners, [x, y] = state.point;
  const area = (by - cy) * (ax - cx) + (cx - bx) * (ay - cy);
  const a = ((by - cy) * (x - cx) + (cx - bx) * (y - cy)) / area;
  const b = ((cy - ay) * (x - cx) + (ax - cx) * (y - cy)) / area;
  return [a, b, 1 - a - b].map(w => Math.round(w * 1000) / 1000);
}

function query() {
  const mix = weights();
  const saturation = at("saturation").value;
  return `weights=${mix.join(",")}` + (saturation === "1" ? "" : `&flake_saturation=${saturation}`);
}

function told() {
  const mix = weights();
  at("caption").textContent = state.names.map((name, k) => `${Math.round(mix[k] * 100)} % ${name}`).join(" · ");
  at("files").replaceChildren(...["zip", "glb", "json"].map(ending => {
    const link = document.createElement("a");
    link.href = `/v1/blends/${state.blend}/realisation.${ending}?${query()}`;
    link.textContent = { zip: "texture bundle", glb: "GLB", json: "JSON" }[ending];
    return link;
  }));
}

// One picture at a time: a quick one while the point moves, a fine one where it rests. A quick one is waited for, so that
// pictures keep coming; a fine one is called off by whatever comes after it.
async function draw(fine) {
  if (!state.blend) return;
  clearTimeout(state.rest);
  if (state.drawing) {
    state.again = fine;
    if (state.drawing.fine) state.drawing.abort.abort();
    return;
  }
  const drawing = state.drawing = { fine, abort: new AbortController() };
  told();
  const size = fine ? "560x560&spp=48" : "280x280&spp=8";
  const picture = at("picture");
  picture.classList.add("stale");
  try {
    const address = `/v1/blends/${state.blend}/preview.png?${query()}&scene=${at("scene").value}&size=${size}`;
    const bytes = await (await ask(address, { signal: drawing.abort.signal })).blob();
    const shown = URL.createObjectURL(bytes);
    picture.onload = () => URL.revokeObjectURL(shown);
    picture.src = shown;
    picture.classList.remove("stale");
  } catch (error) {
    if (error.name !== "AbortError") at("caption").textContent = error.message;
  }
  state.drawing = null;
  const next = state.again;
  state.again = null;
  if (next !== null) draw(next);
  else if (!fine) state.rest = setTimeout(() => draw(true), 250);
}

function moveTo(x, y) {
  state.point = [Math.min(320, Math.max(-20, x)), Math.min(285, Math.max(-20, y))];
  at("handle").setAttribute("cx", state.point[0]);
  at("handle").setAttribute("cy", state.point[1]);
  draw(false);
}

// The last choice wins, in whatever order the answers come.
async function blend() {
  const asked = ++state.asked, chosen = [...state.chosen];
  at("caption").textContent = "Finding how their flakes become one another …";
  const answer = await ask("/v1/blends", {
    method: "POST",
    headers: { "Content-Type": "application/json", Prefer: "wait=30" },
    body: JSON.stringify({ paints: chosen.map(paint => paint.id) }),
  });
  const { id } = await whenDone(answer);
  if (asked !== state.asked) return;
  state.blend = id;
  state.names = chosen.map(paint => paint.name);
  draw(false);
}

async function begin() {
  // On its first start the service answers before all sample paints are made.
  for (let asked = 0; asked < 150 && (await fetch("/readyz")).status === 503; asked++) {
    at("caption").textContent = "Making the sample paints …";
    await new Promise(wake => setTimeout(wake, 200));
  }
  const { paints } = await (await ask("/v1/paints")).json();
  if (paints.length < 3) throw new Error("There are fewer than three paints. Upload some, or start without --no-samples.");
  const first = wanted.map(name => paints.find(paint => paint.name === name));
  const chosen = first.every(Boolean) ? first : paints.slice(0, 3);
  state.chosen = [...chosen];
  at("paints").replaceChildren(...chosen.map((paint, k) => {
    const label = document.createElement("label"), select = document.createElement("select");
    select.append(...paints.map(each => new Option(each.name, each.id, false, each.id === paint.id)));
    select.addEventListener("change", () => {
      state.chosen[k] = paints.find(each => each.id === select.value);
      blend().catch(failed);
    });
    label.append(["Top", "Left", "Right"][k], select);
    return label;
  }));
  await blend();
}

const failed = error => { at("caption").textContent = error.message; };
const triangle = at("triangle");
const place = event => {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(triangle.getScreenCTM().inverse());
  moveTo(point.x, point.y);
};
triangle.addEventListener("pointerdown", event => { triangle.setPointerCapture(event.pointerId); place(event); });
triangle.addEventListener("pointermove", event => { if (event.buttons) place(event); });
at("handle").addEventListener("keydown", event => {
  const step = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, -6], ArrowDown: [0, 6] }[event.key];
  if (!step) return;
  event.preventDefault();
  moveTo(state.point[0] + step[0], state.point[1] + step[1]);
});
at("scene").addEventListener("change", () => draw(true));
at("saturation").addEventListener("input", () => draw(false));
begin().catch(failed);

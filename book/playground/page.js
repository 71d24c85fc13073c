// The page of the playground: reads the controls, and draws what numbers.js computes.
"use strict";

const element = (id) => document.getElementById(id);
const chosen = (name) => document.querySelector(`input[name=${name}]:checked`).value;
const percent = (share) => `${Math.round(100 * share)} %`;

/** What the reader has chosen. */
const choice = () => ({
  signal: chosen("signal"),
  noise: chosen("noise"),
  scale: Number(element("scale").value),
  noisy: element("noisy").checked,
  fault: element("fault").value,
  severity: Number(element("severity").value),
  rate: Number(element("rate").value) / 100,
});

/** Draws a window as a curve, from -1.8 at the foot to 1.8 at the top. */
function draw(path, window) {
  const points = Array.from(window, (value, sample) =>
    `${sample} ${(65 - (65 / 1.8) * Math.max(-1.8, Math.min(1.8, value))).toFixed(1)}`);
  path.setAttribute("d", `M${points.join("L")}`);
}

const place = (score) =>
  (500 * Math.log(Math.max(0.5, Math.min(1000, score)) / 0.5)) / Math.log(2000);

/** Draws scores as ticks, with the threshold, and the shown window longer. */
function drawTicks(id, scores, limit, shown) {
  const ticks = scores.map((score) => `M${place(score).toFixed(1)} 6V20`).join("");
  const mark = shown === undefined ? "" : `M${place(scores[shown]).toFixed(1)} 0V8`;
  element(id).innerHTML = `<path class="tick" d="${ticks}"/><path class="mark" d="${mark}"/>` +
    `<path class="limit" d="M${place(limit).toFixed(1)} 0V20"/>`;
}

function update() {
  const chosenNow = choice(), found = judge(chosenNow), shown = Number(element("shown").value) - 1;
  element("noise").disabled = chosenNow.signal === "real";
  element("scale-value").textContent = chosenNow.scale.toFixed(2);
  element("severity-value").textContent = chosenNow.severity.toFixed(2);
  element("rate-value").textContent = percent(chosenNow.rate);
  element("shown-value").textContent = shown + 1;
  element("alarms").textContent = percent(found.alarms);
  element("recall").textContent = percent(found.recall);
  draw(document.querySelector("#learnt .curve"), found.learnt[shown]);
  draw(document.querySelector("#judged .nominal"), array("judged")[shown]);
  draw(document.querySelector("#judged .curve"), found.windows[shown]);
  document.querySelector("#judged .onset").setAttribute("d", `M${VALUES.onset} 0V130`);
  const isAlarm = found.faulty[shown] > found.limit;
  element("verdict").textContent = isAlarm ? "alarm" : "no alarm";
  element("verdict").className = isAlarm ? "alarm" : "";
  drawTicks("strip-learnt", found.scores, found.limit);
  drawTicks("strip-real", found.real, found.limit, shown);
  drawTicks("strip-faulty", found.faulty, found.limit, shown);
  element("views").innerHTML = VIEWS.map((name, view) => {
    const score = found.views[shown][view].toFixed(2);
    return `<tr><th>${name}</th><td><progress max="10" value="${score}"></progress></td>` +
      `<td>${score}</td></tr>`;
  }).join("");
  element("sum").textContent = found.faulty[shown].toFixed(2);
  element("threshold").textContent = found.limit.toFixed(2);
}

// -- the vote -------------------------------------------------------------------------------------

const votes = { number: 0, reader: 0, machine: 0 };
const normal = normalNumbers(Date.now());
let asked;

function ask() {
  asked = question(normal);
  draw(document.querySelector("#question .curve"), asked.window);
}

function vote(generated) {
  votes.number += 1;
  votes.reader += generated === asked.generated;
  votes.machine += asked.machine === asked.generated;
  const kind = asked.generated ? "generated" : "real";
  const chance = percent(byGuessing(votes.reader, votes.number));
  element("count").textContent = `That one was ${kind}. You: ${votes.reader} of ${votes.number} ` +
    `right; the classifier: ${votes.machine}. By guessing, one has at least as many right as you ` +
    `in ${chance} of cases. The next one is above.`;
  ask();
}

element("controls").addEventListener("input", update);
element("controls").addEventListener("submit", (event) => event.preventDefault());
element("say-real").addEventListener("click", () => vote(false));
element("say-generated").addEventListener("click", () => vote(true));
update();
ask();

// The numbers of the playground: what enhsim_tf computes in Python. A window is a Float64Array.
"use strict";

const VIEWS = ["subspace", "level", "spread", "step"];
const FLAT = 1e-6, SHRINKAGE = 0.01, LEAST_UNIT = 0.01; // as in `enhsim_tf.scoring`
const SEED = 1; // of all draws

// -- arrays of data.js ----------------------------------------------------------------------------

const TYPES = { int16: Int16Array, float32: Float32Array, float64: Float64Array };

/** The rows of a packed array, in units of the signal. */
function unpack(name) {
  const { type, unit, shape, base64 } = PACKED[name];
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const flat = Float64Array.from(new TYPES[type](bytes.buffer), (value) => value * unit);
  const width = shape[shape.length - 1];
  return Array.from({ length: flat.length / width }, (_, row) =>
    flat.subarray(row * width, (row + 1) * width));
}

const memory = new Map();

/** The value of a function without side effects, computed once for a key. */
function once(key, make) {
  if (!memory.has(key)) memory.set(key, make());
  return memory.get(key);
}

const array = (name) => once(name, () => unpack(name));

// -- signals --------------------------------------------------------------------------------------

/** The true signal at a time in seconds: a sum of sines. */
function truth(time) {
  let sum = 0;
  for (const [period, size] of VALUES.waves) sum += size * Math.sin((2 * Math.PI * time) / period);
  return sum;
}

/** The coarse simulation: square waves of the same periods. */
function coarse(time) {
  let sum = 0;
  for (const [period, size] of VALUES.waves) {
    const turns = time / period;
    sum += turns - Math.floor(turns) < 0.5 ? size : -size;
  }
  return sum;
}

/** The times of a window. */
const times = (begin) =>
  Float64Array.from({ length: VALUES.window }, (_, sample) => begin + sample * VALUES.interval);

/** A signal in a degraded mode; see `enhsim_tf.paper.degraded`. */
function degrade(begin, mode, severity) {
  const time = times(begin), { onset, levels: [low, high] } = VALUES;
  const first = time[onset], last = time[time.length - 1];
  return time.map((now, sample) => {
    if (sample < onset) return truth(now);
    const after = now - first;
    if (mode === "stuck") return truth(after <= severity * (last - first) ? first : now);
    if (mode === "period_change") return truth(first + after / (1 + severity));
    if (mode === "gain_loss") {
      return (low + high) / 2 + (1 - severity) * (truth(now) - (low + high) / 2);
    }
    const share = (sample - onset) / (time.length - 1 - onset);
    return truth(now) + severity * (high - low) * share; // drift
  });
}

const add = (one, other, scale = 1) => one.map((value, sample) => value + scale * other[sample]);

/** Real windows that are judged, with a fault: the noise of the telemetry stays. */
const faulty = (mode, severity) =>
  array("judged").map((window, number) => {
    const begin = array("judged_time")[0][number];
    const noise = add(window, times(begin).map(truth), -1);
    return add(degrade(begin, mode, severity), noise);
  });

// -- noise ----------------------------------------------------------------------------------------

/** A generator of normally distributed numbers: mulberry32, and Box and Muller's method. */
function normalNumbers(seed) {
  let state = seed | 0;
  const uniform = () => {
    state = (state + 0x6d2b79f5) | 0;
    let mixed = Math.imul(state ^ (state >>> 15), 1 | state);
    mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), 61 | mixed)) ^ mixed;
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 4294967296;
  };
  return () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
}

const drawWindow = (normal, size) => Float64Array.from({ length: size }, normal);

/** One window of the GAN's generator for a latent vector. */
function generate(latent) {
  const parts = Array.from({ length: 8 }, (_, number) => array(`generator_${number}`));
  const [inputs, [bias], [gamma], [beta], [mean], [variance], outputs, [last]] = parts;
  const hidden = bias.map((value, unit) => {
    for (let each = 0; each < latent.length; each++) value += latent[each] * inputs[each][unit];
    const normed = (Math.max(value, 0) - mean[unit]) / Math.sqrt(variance[unit] + VALUES.epsilon);
    return gamma[unit] * normed + beta[unit];
  });
  const window = Float64Array.from(last);
  hidden.forEach((value, unit) => {
    for (let sample = 0; sample < window.length; sample++) {
      window[sample] += value * outputs[unit][sample];
    }
  });
  return VALUES.activation === "tanh" ? window.map(Math.tanh) : window;
}

const drawLatent = (normal) =>
  drawWindow(normal, VALUES.latent).map((value) => VALUES.latent_scale * value);

/** As many windows of noise as windows are learnt; residuals are those of the next window. */
const noiseWindows = (kind) => once(`noise ${kind}`, () => {
  const normal = normalNumbers(SEED), clean = array("enhanced"), real = array("real");
  return clean.map((_, number) => {
    if (kind === "gaussian") {
      return drawWindow(normal, VALUES.window).map((value) => VALUES.noise_sd * value);
    }
    if (kind === "gan") return generate(drawLatent(normal));
    const next = (number + 1) % clean.length;
    if (kind === "residuals") return add(real[next], clean[next], -1);
    return new Float64Array(VALUES.window);
  });
});

/** The windows that the detector learns. */
function trainingWindows({ signal, noise, scale }) {
  if (signal === "real") return array("real");
  const clean = signal === "enhanced" ? array("enhanced") : once("coarse", () =>
    [...array("training_time")[0]].map((begin) => times(begin).map(coarse)));
  return clean.map((window, number) => add(window, noiseWindows(noise)[number], scale));
}

// -- the detector ---------------------------------------------------------------------------------

const average = (values) => total(values) / values.length;

function deviation(values) {
  const middle = average(values);
  return Math.sqrt(average(values.map((value) => (value - middle) ** 2)));
}

/** A quantile, linear between two values, as NumPy's. */
function quantile(values, share) {
  const sorted = Float64Array.from(values).sort(), place = share * (sorted.length - 1);
  const below = Math.floor(place), above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (place - below) * (sorted[above] - sorted[below]);
}

const total = (values) => values.reduce((sum, value) => sum + value, 0);

const product = (one, other) => total(one.map((value, sample) => value * other[sample]));

/** What is left of a window outside of directions, the mean of which is the first row. */
function outside(window, [mean, ...directions]) {
  const centred = add(window, mean, -1), left = Float64Array.from(centred);
  for (const direction of directions) {
    const size = product(centred, direction);
    direction.forEach((value, sample) => (left[sample] -= size * value));
  }
  return left;
}

/** What four views of `enhsim_tf.scoring.views` see of a window, before they compare. */
function look(window, directions) {
  let step = 0;
  for (let sample = 1; sample < window.length; sample++) {
    step = Math.max(step, Math.abs(window[sample] - window[sample - 1]));
  }
  const rest = outside(window, directions), distance = Math.sqrt(product(rest, rest));
  return [distance, average(window), Math.log(deviation(window) + FLAT), step];
}

/** Learns windows, and returns the function that gives the scores of a window in the four views. */
function learn(windows, directions) {
  const seen = windows.map((window) => look(window, directions));
  const [, levels, spreads, steps] = VIEWS.map((_, view) => seen.map((row) => row[view]));
  const variance = deviation(levels) ** 2 * (levels.length / (levels.length - 1));
  const size = Math.sqrt((1 + SHRINKAGE) * variance + FLAT ** 2);
  const middle = average(levels), median = quantile(spreads, 0.5), most = Math.max(...steps);
  const views = ([distance, level, spread, step]) =>
    [distance, Math.abs(level - middle) / size, Math.abs(spread - median), step / most];
  const learnt = seen.map(views);
  const units = VIEWS.map((_, view) =>
    Math.max(quantile(learnt.map((row) => row[view]), 0.99), LEAST_UNIT));
  return (window) => views(look(window, directions)).map((value, view) => value / units[view]);
}

/** The conformal threshold for a rate; see `enhsim_tf`'s function of the same name. */
function threshold(scores, rate) {
  const rank = Math.ceil((scores.length + 1) * (1 - rate) - 1e-9);
  return rank > scores.length ? Infinity : Float64Array.from(scores).sort()[rank - 1];
}

/** Everything that the page shows for a choice. */
function judge(choice) {
  const { signal, noise, scale, noisy, fault, severity, rate } = choice;
  const key = ["detector", signal, noise, scale, noisy].join(" ");
  const knows = noisy && signal === "enhanced" && noise !== "none" ? noise : signal;
  if (!memory.has(key)) for (const old of memory.keys()) {
    if (old.startsWith("detector")) memory.delete(old);
  }
  const detector = once(key, () => {
    const learnt = trainingWindows(choice), views = learn(learnt, array(`${knows}_directions`));
    const [scores, real] = [learnt, array("judged")].map((windows) =>
      windows.map((window) => total(views(window))));
    return { learnt, views, scores, real };
  });
  const limit = threshold(detector.scores, rate), windows = faulty(fault, severity);
  const views = windows.map(detector.views), scores = views.map(total);
  const share = (values) => average(values.map((value) => (value > limit ? 1 : 0)));
  return { ...detector, limit, windows, views, faulty: scores, alarms: share(detector.real),
    recall: share(scores) };
}

// -- the vote -------------------------------------------------------------------------------------

/** The share of a window's noise that lies in the directions of the generator's noise. */
function patternShare(window) {
  const noise = outside(window, array("enhanced_directions"));
  const [mean, ...directions] = array("pattern");
  const left = outside(noise, [mean.map(() => 0), ...directions]);
  return 1 - average(left.map((value) => value * value)) /
    average(noise.map((value) => value * value));
}

/** Between the medians of learnt windows of both kinds. */
const voteLimit = () => once("vote", () => {
  const generated = trainingWindows({ signal: "enhanced", noise: "gan", scale: 1 });
  return average([generated, array("real")].map((windows) =>
    quantile(windows.map(patternShare), 0.5)));
});

/** A question of the vote; real windows are those that are judged. */
function question(normal) {
  const generated = normal() > 0;
  const place = (number) => Math.floor(Math.abs(normal()) * 1e6) % number;
  const window = generated
    ? add(array("enhanced")[place(array("enhanced").length)], generate(drawLatent(normal)))
    : array("judged")[place(array("judged").length)];
  return { generated, window, machine: patternShare(window) > voteLimit() };
}

/** The probability of at least so many right answers by guessing. */
function byGuessing(right, number) {
  let chance = 0;
  for (let row = 0, ways = 1; row <= number; row++) {
    if (row >= right) chance += ways;
    ways = (ways * (number - row)) / (row + 1);
  }
  return chance / 2 ** number;
}

'use strict';

/** Milliseconds without a key before a design begins, and before the page says that it is at work. */
const PAUSE = 250;
const PATIENCE = 300;
/** The loudest sample of the three recordings. */
const LOUDEST = 0.7;
/** Pictures that are always seen. */
const SHOWN = ['tones', 'error', 'filters'];

const $ = id => document.getElementById(id);

/** An element with attributes and children. */
function element(name, attributes = {}, ...children) {
  const made = Object.assign(document.createElement(name), attributes);
  made.append(...children);
  return made;
}

/** What a run that was ended by `stop` throws. */
class Stopped extends Error {}

/** The program in a worker, which does one thing at a time. */
class Program {
  constructor(module, source) {
    this.module = module;
    this.source = source;
    this.begin();
  }

  begin() {
    this.worker = new Worker(this.source);
    this.worker.postMessage({ module: this.module });
  }

  get busy() { return this.pending !== undefined; }

  /** Runs the program; resolves to its answer. `line` takes each line of its messages. */
  ask(args, input, line = () => {}) {
    this.stop();
    return new Promise((resolve, reject) => {
      this.pending = reject;
      const end = act => value => {
        this.pending = undefined;
        act(value);
      };
      this.worker.onmessage = ({ data }) => {
        if (data.line !== undefined) line(data.line);
        else if (data.failed !== undefined) end(reject)(new Error(data.failed));
        else end(resolve)(data);
      };
      this.worker.onerror = event => end(reject)(new Error(event.message || 'the worker failed'));
      this.worker.postMessage({ args, input });
    });
  }

  /** Ends what runs, whatever it does. */
  stop() {
    if (!this.busy) return;
    const reject = this.pending;
    this.pending = undefined;
    this.worker.terminate();
    this.begin();
    reject(new Stopped());
  }
}

const encoded = text => new TextEncoder().encode(text);

function download(name, text, type) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  element('a', { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

function image(svg, alt) {
  return element('img', { src: 'data:image/svg+xml,' + encodeURIComponent(svg), alt });
}

// The editor.

/** Numbers of lines, and the place that a refusal is about. */
function drawEditor(place) {
  const lines = $('spec').value.split('\n');
  const numbers = lines.map((_, i) => {
    const text = `${i + 1}\n`;
    return place && place.line === i + 1 ? element('b', {}, text) : text;
  });
  $('gutter').replaceChildren(...numbers);
  if (!place) {
    $('marks').textContent = '';
  } else {
    const [start, end] = range(place);
    const text = $('spec').value;
    const mark = element('mark', {}, text.slice(start, end) || ' ');
    $('marks').replaceChildren(text.slice(0, start), mark, text.slice(end) + '\n');
  }
  scrollEditor();
}

function scrollEditor() {
  $('gutter').scrollTop = $('marks').scrollTop = $('spec').scrollTop;
  $('marks').scrollLeft = $('spec').scrollLeft;
}

/** Where a place begins and ends in the text. Columns count characters, and the text UTF-16 units. */
function range({ line, column, width }) {
  const lines = $('spec').value.split('\n');
  const before = lines.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0);
  const characters = [...(lines[line - 1] ?? '')];
  const units = count => characters.slice(0, count).join('').length;
  return [before + units(column - 1), before + units(column - 1 + width)];
}

function showRefusal(refused) {
  $('refusal').hidden = !refused;
  $('spec').setAttribute('aria-invalid', String(Boolean(refused)));
  $('refusal').replaceChildren();
  drawEditor(refused?.place);
  if (!refused) return;
  // The line with its carets stands below the message.
  const [message, ...excerpt] = refused.message.split('\n');
  $('refusal').append(element('p', {}, message));
  if (excerpt.length) $('refusal').append(element('pre', {}, excerpt.join('\n')));
  if (refused.place) {
    const there = () => {
      $('spec').focus();
      $('spec').setSelectionRange(...range(refused.place));
    };
    $('refusal').append(element('button', { type: 'button', onclick: there }, `Go to line ${refused.place.line}`));
  }
}

// The bank.

const state = { bank: undefined, recordings: undefined };

function status(text) {
  $('status').textContent = text;
}

/** Six significant digits of a bound, rounded to the side on which it still is one. */
function bound(value, round) {
  const unit = 10 ** (Math.floor(Math.log10(Math.abs(value) || 1)) - 5);
  return String(Number((round(value / unit) * unit).toPrecision(6)));
}

function showHeadline({ proven, unproven, error }) {
  if (proven) {
    $('interval').textContent = `${bound(proven.lower, Math.floor)} \u2264 gamma \u2264 ${bound(proven.upper, Math.ceil)}`;
    $('proof').textContent = '\u2713 proven on this page';
  } else {
    $('interval').textContent = `gamma ${error.find(({ name }) => name === 'gamma')?.value ?? 'unknown'}`;
    $('proof').textContent = 'computed, not proven';
  }
  $('proof').className = proven ? 'good' : 'doubt';
  $('why').hidden = !unproven;
  $('why').textContent = unproven ?? '';
}

function showRows(table, rows) {
  const row = ({ name, value, meaning }) => element('tr', {}, element('th', { scope: 'row' }, name),
    element('td', { className: 'value' }, value), element('td', {}, meaning));
  $(table).tBodies[0].replaceChildren(...rows.map(row));
}

function showChannels(channels) {
  const percent = share => share === null ? 'no derivative' : `${share >= 0 ? '+' : '\u2212'}${Math.abs(100 * share).toFixed(2)} %`;
  const row = ({ delay, gain, sensitivity }, i) => element('tr', {},
    ...[String(i + 1), delay, gain, percent(sensitivity)].map(text => element('td', {}, text)));
  $('channels').tBodies[0].replaceChildren(...channels.map(row));
}

function showBank(designed) {
  state.bank = designed.bank;
  $('right').hidden = false;
  $('right').classList.remove('stale');
  $('bank').disabled = false;
  $('title').textContent = designed.title;
  $('understood').textContent = designed.understood;
  showHeadline(designed);
  $('warnings').hidden = designed.warnings.length === 0;
  $('warnings').replaceChildren(...designed.warnings.map(text => element('li', {}, text)));
  showRows('error', designed.error);
  showRows('cost', designed.cost);
  showChannels(designed.channels);
  markPictures(true);
  status(`designed in ${milliseconds(designed.seconds)}, proof in ${milliseconds(designed.proof_seconds)}`);
}

function milliseconds(seconds) {
  const value = 1e3 * seconds;
  return `${value < 100 ? value.toFixed(1) : value.toFixed(0)} ms`;
}

/** The pictures of the last bank stay until those of the next one are drawn. */
function markPictures(stale) {
  for (const id of ['pictures', 'others']) $(id).classList.toggle('stale', stale);
}

function showPictures(pictures) {
  markPictures(false);
  const figure = ({ svg, caption, title }) => element('figure', {},
    element('div', { className: 'wide', tabIndex: 0 }, image(svg, title)), element('figcaption', {}, caption));
  const named = name => pictures.find(picture => picture.name === name);
  $('pictures').replaceChildren(...SHOWN.map(name => figure(named(name))));
  $('others').replaceChildren(...pictures.filter(({ name }) => !SHOWN.includes(name)).map(figure));
}

/** Says what a design does, with the time that has passed. */
function progress() {
  const begin = performance.now();
  let step = 'designing', expected = 0;
  const show = () => {
    const seconds = (performance.now() - begin) / 1e3;
    const of = expected > seconds ? ` of up to ${expected.toPrecision(2)} s` : '';
    if (1e3 * seconds < PATIENCE) return;
    $('stop').hidden = false;
    status(`${step}: ${seconds.toFixed(1)} s${of}`);
  };
  const timer = setInterval(show, 100);
  return {
    line(text) {
      const [, seconds, what] = text.match(/^(\S+) (.*)$/) ?? [];
      [step, expected] = [what ?? step, Number(seconds) || 0];
    },
    end() {
      clearInterval(timer);
      $('stop').hidden = true;
    },
  };
}

/** Designs the bank of the spec as it stands. */
async function design(program) {
  $('again').hidden = true;
  const { line, end } = progress();
  try {
    const { answer } = await program.ask(['design'], encoded($('spec').value), line);
    end();
    showRefusal(answer.refused);
    if (answer.refused) {
      status('');
      return;
    }
    silence();
    showBank(answer);
    const { answer: pictures } = await program.ask(['pictures'], encoded(answer.bank));
    if (pictures.refused) status(pictures.refused.message);
    else showPictures(pictures);
  } catch (problem) {
    if (problem instanceof Stopped) return;
    status(`the design failed: ${problem.message}`);
  } finally {
    end();
  }
}

// Sound.

const player = { context: undefined, sources: [], gains: [] };

function stopPlaying() {
  player.sources.forEach(source => {
    source.onended = null;
    source.stop();
  });
  player.sources = [];
  $('play').textContent = 'Play';
}

/** The recordings of the last bank are not those of the next one. */
function silence() {
  stopPlaying();
  $('sound').hidden = true;
  $('sound-status').textContent = '';
}

const chosen = () => Number(document.querySelector('input[name="playback"]:checked').value);

/** All three recordings run at once and one of them sounds, so the choice can change in the middle. */
function play() {
  if (player.sources.length) {
    stopPlaying();
    return;
  }
  player.context ??= new AudioContext();
  player.context.resume();
  const { rate, recordings } = state.recordings;
  const begin = player.context.currentTime + 0.05;
  player.gains = recordings.map((_, i) => new GainNode(player.context, { gain: i === chosen() ? 1 : 0 }));
  player.sources = recordings.map((samples, i) => {
    const buffer = player.context.createBuffer(1, samples.length, rate);
    buffer.copyToChannel(samples, 0);
    const source = new AudioBufferSourceNode(player.context, { buffer });
    source.connect(player.gains[i]).connect(player.context.destination);
    source.start(begin);
    return source;
  });
  player.sources[0].onended = stopPlaying;
  $('play').textContent = 'Stop';
}

function choosePlayback() {
  player.gains.forEach((gain, i) => gain.gain.setTargetAtTime(i === chosen() ? 1 : 0, player.context.currentTime, 0.01));
}

/** The samples of the three recordings, as loud as their loudest one allows. */
function divided(samples, length) {
  const peak = samples.reduce((most, x) => Math.max(most, Math.abs(x)), 0) || 1;
  const scaled = samples.map(x => x * LOUDEST / peak);
  return [0, 1, 2].map(i => scaled.subarray(i * length, (i + 1) * length));
}

async function signalInput() {
  const bank = encoded(state.bank);
  if ($('signal').value !== 'recording') return bank;
  const [file] = $('file').files;
  if (!file) throw new Error('choose a WAV file first');
  return new Blob([bank, new Uint8Array(1), file]).arrayBuffer().then(buffer => new Uint8Array(buffer));
}

async function capture(program) {
  silence();
  $('sound-status').textContent = 'capturing';
  try {
    const { answer, samples } = await program.ask(['listen', $('signal').value], await signalInput());
    if (answer.refused) throw new Error(answer.refused.message);
    state.recordings = { rate: answer.rate, recordings: divided(samples, answer.samples) };
    $('sound').hidden = false;
    $('sound-status').textContent = '';
    $('sound-text').textContent = `${answer.text}.`;
    $('snr-1').textContent = decibels(answer.interleaved_snr);
    $('snr-2').textContent = decibels(answer.fused_snr);
    $('spectra').src = image(answer.svg, '').src;
  } catch (problem) {
    $('sound-status').textContent = problem instanceof Stopped ? '' : problem.message;
  }
}

/** A signal-to-noise ratio; none where there is no signal or no error. */
const decibels = value => value === null ? '' : `${value.toFixed(1)} dB`;

// The page.

/** The program, which stands compressed in the page. */
async function compiled() {
  const text = atob($('program').textContent.trim());
  const bytes = Uint8Array.from(text, character => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return WebAssembly.compile(await new Response(stream).arrayBuffer());
}

function chooseExample(examples) {
  $('spec').value = examples[$('example').selectedIndex].textContent.trimStart();
  $('spec').scrollTop = 0;
  drawEditor();
}

async function begin() {
  const examples = [...document.querySelectorAll('script.example')];
  $('example').append(...examples.map(example => element('option', {}, example.title)));
  chooseExample(examples);
  const module = await compiled();
  const source = URL.createObjectURL(new Blob([$('worker').textContent], { type: 'text/javascript' }));
  const [designer, listener] = [new Program(module, source), new Program(module, source)];
  let timer;
  const later = delay => {
    clearTimeout(timer);
    designer.stop();
    listener.stop();
    $('right').classList.add('stale');
    $('bank').disabled = true;
    timer = setTimeout(() => design(designer), delay);
  };
  $('spec').oninput = () => {
    drawEditor();
    later(PAUSE);
  };
  $('spec').onscroll = scrollEditor;
  $('spec').onkeydown = event => {
    if (event.key === 'Enter' && (event.ctrlKey || event.metaKey)) later(0);
  };
  $('example').onchange = () => {
    chooseExample(examples);
    later(0);
  };
  $('stop').onclick = () => {
    designer.stop();
    $('again').hidden = false;
    status('stopped');
  };
  $('again').onclick = () => later(0);
  $('bank').onclick = () => download('bank.json', state.bank, 'application/json');
  $('toml').onclick = () => download('spec.toml', $('spec').value, 'application/toml');
  $('signal').onchange = () => { $('file').hidden = $('signal').value !== 'recording'; };
  $('capture').onclick = () => capture(listener);
  $('play').onclick = play;
  document.querySelectorAll('input[name="playback"]').forEach(input => { input.onchange = choosePlayback; });
  later(0);
}

begin().catch(problem => status(`this browser cannot run the page: ${problem.message}`));

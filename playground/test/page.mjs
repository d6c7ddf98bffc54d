// Uses the page as a person does: node page.mjs BROWSER PAGE FOLDER, with HYBANK and PICTURES of ../test.sh.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { gzipSync } from 'node:zlib';
import { Chromium } from './chromium.mjs';

const [browser, page, folder] = process.argv.slice(2);
const { HYBANK: hybank, PICTURES: pictures } = process.env;
/** Largest size of the page as it is sent, bytes. */
const MOST_BYTES = 1.5e6;
/** Seconds of a frame that a person would feel while typing; a busy machine takes some by itself. */
const MOST_PAUSE = 0.25;
/** Milliseconds of the thesis's design. */
const MOST_DESIGN = 100;
const WIDTHS = [1200, 400];

const chromium = await Chromium.start(browser, join(folder, 'profile'));
const requests = [], complaints = [];
chromium.on((method, params) => {
  if (method === 'Network.requestWillBeSent') requests.push(params.request.url);
  if (method === 'Runtime.exceptionThrown') complaints.push(params.exceptionDetails.exception?.description);
  if (method === 'Log.entryAdded') complaints.push(params.entry.text);
  if (method === 'Runtime.consoleAPICalled') complaints.push(JSON.stringify(params.args));
});
for (const domain of ['Page', 'Network', 'Runtime', 'Log', 'DOM']) await chromium.send(`${domain}.enable`);
await chromium.send('Page.setDownloadBehavior', { behavior: 'allow', downloadPath: folder });

const text = id => chromium.value(`document.getElementById('${id}').innerText`);
const click = id => chromium.value(`document.getElementById('${id}').click()`);
const example = name => readFileSync(new URL(`../../filters/${name}.toml`, import.meta.url), 'utf8');
const designed = () => chromium.until(
  `/^designed/.test(document.getElementById('status').innerText) && !document.getElementById('right').classList.contains('stale')`);

/** Types a whole spec; what the page did before is over then. */
const type = spec => chromium.value(`(() => {
  const editor = document.getElementById('spec');
  editor.value = ${JSON.stringify(spec)};
  document.getElementById('status').textContent = '';
  editor.dispatchEvent(new Event('input'));
})()`);

async function downloaded(name, id) {
  await click(id);
  const path = join(folder, name);
  const end = Date.now() + 20e3;
  while (!existsSync(path) && Date.now() < end) await new Promise(resolve => setTimeout(resolve, 20));
  return readFileSync(path, 'utf8');
}

async function isSmall() {
  const size = gzipSync(readFileSync(page), { level: 9 }).length;
  assert.ok(size <= MOST_BYTES, `${size} bytes compressed`);
  return `${size} bytes compressed`;
}

async function designs() {
  await chromium.send('Page.navigate', { url: `file://${page}` });
  await chromium.until(`document.readyState === 'complete' && !!document.getElementById('status')`);
  await designed();
  assert.match(await text('interval'), /^0\.0000026\d+ ≤ gamma ≤ 0\.0000026\d+$/);
  assert.match(await text('proof'), /proven on this page/);
  await chromium.until(`document.querySelectorAll('#pictures img').length === 3`);
  await chromium.until(`document.querySelectorAll('#others img').length === 6`);
  await chromium.until(`[...document.querySelectorAll('#pictures img')].every(image => image.naturalWidth > 0)`);
  return text('interval');
}

/** The fastest of some designs: the first ones run before the browser has optimised the program. */
async function isFast() {
  const times = [];
  for (let run = 0; run < 12; run++) {
    await type(example('thesis-fir') + `# ${run}\n`);
    await designed();
    const [, design, proof] = (await text('status')).match(/^designed in ([\d.]+) ms, proof in ([\d.]+) ms/);
    times.push([Number(design), Number(proof)]);
  }
  const fastest = Math.min(...times.map(([design]) => design));
  assert.ok(fastest <= MOST_DESIGN, `the thesis's design takes ${fastest} ms`);
  return 'thesis design and proof, ms: ' + times.map(([design, proof]) => `${design} + ${proof}`).join(', ');
}

async function refuses() {
  const bad = example('speech-2x').replace('order = 4', 'ordre = 4');
  await type(bad);
  await chromium.until(`!document.getElementById('refusal').hidden`);
  const message = await text('refusal');
  const line = bad.split('\n').findIndex(text => text.includes('ordre')) + 1;
  for (const part of [`spec.toml:${line}:`, 'unknown key "ordre"', 'did you mean "order"?', '^^^^^', `Go to line ${line}`]) {
    assert.ok(message.includes(part), `${part} is not in ${message}`);
  }
  assert.equal(await chromium.value(`document.querySelector('#marks mark').textContent`), 'ordre');
  await chromium.value(`document.querySelector('#refusal button').click()`);
  assert.equal(await chromium.value(`(({ value, selectionStart, selectionEnd }) => value.slice(selectionStart, selectionEnd))(document.getElementById('spec'))`), 'ordre');
  // The bank of the last good spec is seen as such.
  assert.ok(await chromium.value(`document.getElementById('right').classList.contains('stale')`));
  assert.ok(await chromium.value(`document.getElementById('bank').disabled`));
  await look('error');
  // What is refused after the text was read has no place.
  await type(example('thesis-fir').replace('taps = 22', 'taps = 2').replace('latency = 10', 'latency = 900'));
  await chromium.until(`!document.getElementById('refusal').hidden || /^designed/.test(document.getElementById('status').innerText)`);
  return message.split('\n')[0];
}

async function downloads() {
  await type(example('thesis-fir'));
  await designed();
  const bank = JSON.parse(await downloaded('bank.json', 'bank'));
  assert.equal(await downloaded('spec.toml', 'toml'), example('thesis-fir'));
  if (!hybank) return 'not compared: HYBANK is not set';
  // A proof holds for the bits of the file, so it holds everywhere.
  const proven = JSON.parse(execFileSync(hybank, ['verify', join(folder, 'bank.json'), '--json'], { encoding: 'utf8' }));
  execFileSync(hybank, ['design', join(folder, 'spec.toml'), '-o', join(folder, 'native.json')], { stdio: 'ignore' });
  const native = JSON.parse(readFileSync(join(folder, 'native.json'), 'utf8'));
  assert.deepEqual(Object.keys(bank), Object.keys(native));
  assert.deepEqual(bank.spec, native.spec);
  const apart = (a, b) => Math.abs(a / b - 1);
  assert.ok(apart(bank.gamma.norm, native.gamma.norm) < 1e-9);
  const taps = ({ channels }) => channels.flatMap(channel => channel.taps);
  const differences = taps(bank).map((tap, k) => Math.abs(tap - taps(native)[k]));
  const largest = Math.max(...differences);
  assert.ok(largest < 1e-6, `taps differ by ${largest}`);
  const same = readFileSync(join(folder, 'bank.json')).equals(readFileSync(join(folder, 'native.json')));
  return `verified natively: ${proven.lower} to ${proven.upper}; ${same ? 'the same bytes' : `taps differ by at most ${largest.toExponential(1)}, gamma by ${apart(bank.gamma.norm, native.gamma.norm).toExponential(1)}`}`;
}

/** Two seconds of two tones, 16 bits, at 44.1 kHz. */
function wav() {
  const rate = 44100, samples = 2 * rate;
  const bytes = Buffer.alloc(44 + 2 * samples);
  bytes.write('RIFF', 0);
  bytes.writeUInt32LE(36 + 2 * samples, 4);
  bytes.write('WAVEfmt ', 8);
  bytes.writeUInt32LE(16, 16);
  bytes.writeUInt16LE(1, 20);
  bytes.writeUInt16LE(1, 22);
  bytes.writeUInt32LE(rate, 24);
  bytes.writeUInt32LE(2 * rate, 28);
  bytes.writeUInt16LE(2, 32);
  bytes.writeUInt16LE(16, 34);
  bytes.write('data', 36);
  bytes.writeUInt32LE(2 * samples, 40);
  for (let n = 0; n < samples; n++) {
    const tone = f => 0.3 * Math.sin(2 * Math.PI * f * n / rate);
    bytes.writeInt16LE(Math.round(32767 * (tone(500) + tone(5200))), 44 + 2 * n);
  }
  return bytes;
}

async function sounds() {
  await type(example('speech-2x'));
  await designed();
  writeFileSync(join(folder, 'tones.wav'), wav());
  const said = [];
  for (const signal of ['sweep', 'chord', 'recording']) {
    await chromium.value(`(() => {
      const choice = document.getElementById('signal');
      choice.value = '${signal}';
      choice.dispatchEvent(new Event('change'));
    })()`);
    if (signal === 'recording') {
      const { root } = await chromium.send('DOM.getDocument');
      const { nodeId } = await chromium.send('DOM.querySelector', { nodeId: root.nodeId, selector: '#file' });
      await chromium.send('DOM.setFileInputFiles', { nodeId, files: [join(folder, 'tones.wav')] });
    }
    await click('capture');
    await chromium.until(`!document.getElementById('sound').hidden`);
    const [before, after] = [parseFloat(await text('snr-1')), parseFloat(await text('snr-2'))];
    assert.ok(after > before + 10, `${signal}: ${before} dB before, ${after} dB after`);
    said.push(`${signal} ${before} -> ${after} dB`);
  }
  await click('play');
  assert.equal(await text('play'), 'Stop');
  await chromium.value(`document.querySelector('input[name="playback"][value="1"]').click()`);
  await click('play');
  assert.equal(await text('play'), 'Play');
  return said.join(', ');
}

/** A design of minutes: the page goes on, and the design can be ended. */
async function staysAwake() {
  await type(example('interleaved-4x250M').replace('taps = 24', 'taps = 400'));
  await chromium.until(`!document.getElementById('stop').hidden`);
  const pause = await chromium.value(`new Promise(resolve => {
    let last = performance.now(), longest = 0, frames = 0;
    const frame = now => {
      longest = Math.max(longest, now - last);
      last = now;
      if (++frames < 60) requestAnimationFrame(frame);
      else resolve(longest / 1e3);
    };
    requestAnimationFrame(frame);
  })`);
  assert.ok(pause < MOST_PAUSE, `a frame took ${pause} s`);
  const working = await text('status');
  await click('stop');
  assert.equal(await text('status'), 'stopped');
  await type(example('thesis-iir'));
  await designed();
  return `longest frame ${(1e3 * pause).toFixed(0)} ms beside "${working}"`;
}

async function look(name) {
  for (const scheme of ['light', 'dark']) {
    await chromium.send('Emulation.setEmulatedMedia', { features: [{ name: 'prefers-color-scheme', value: scheme }] });
    for (const width of WIDTHS) {
      await chromium.send('Emulation.setDeviceMetricsOverride', { width, height: 900, deviceScaleFactor: 1, mobile: false });
      const wide = await chromium.value('document.documentElement.scrollWidth - document.documentElement.clientWidth');
      assert.equal(wide, 0, `${wide} pixels too wide at ${width}`);
      if (!pictures) continue;
      mkdirSync(pictures, { recursive: true });
      const { data } = await chromium.send('Page.captureScreenshot', { captureBeyondViewport: true, clip: {
        x: 0, y: 0, width, scale: 1, height: Math.min(4000, await chromium.value('document.documentElement.scrollHeight')) } });
      writeFileSync(join(pictures, `${name}-${width}-${scheme}.png`), Buffer.from(data, 'base64'));
    }
  }
  return `${WIDTHS.join(' and ')} pixels, light and dark`;
}

async function looks() {
  await type(example('speech-2x'));
  await designed();
  await click('capture');
  await chromium.until(`!document.getElementById('sound').hidden`);
  return look('page');
}

async function loadsNothing() {
  const foreign = requests.filter(url => !/^(blob|data):/.test(url) && url !== `file://${page}`);
  assert.deepEqual(foreign, []);
  const refused = await chromium.value(`fetch('https://example.org/').then(() => 'fetched', () => 'refused')`);
  assert.equal(refused, 'refused');
  // That refusal is the only complaint.
  assert.deepEqual(complaints.filter(text => !/example\.org/.test(text)), []);
  return `${requests.length} requests, all within the page`;
}

let failed = 0;
for (const part of [isSmall, designs, isFast, refuses, downloads, sounds, staysAwake, looks, loadsNothing]) {
  try {
    console.log(`ok ${part.name}: ${await part()}`);
  } catch (problem) {
    failed++;
    console.log(`FAILED ${part.name}: ${problem.message}`);
  }
}
await chromium.end();
process.exit(failed ? 1 : 0);

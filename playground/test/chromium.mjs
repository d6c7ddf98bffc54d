// A headless Chromium, driven over the pipe of its debugging protocol: nothing has to be installed for that.

import { spawn } from 'node:child_process';

const FLAGS = ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-sync',
  '--disable-background-networking', '--disable-component-update', '--autoplay-policy=no-user-gesture-required',
  '--remote-debugging-pipe'];

export class Chromium {
  /** Starts `program` with a profile of its own. */
  static async start(program, profile) {
    const chromium = new Chromium();
    chromium.process = spawn(program, [...FLAGS, `--user-data-dir=${profile}`],
      { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
    chromium.waiting = new Map();
    chromium.listeners = [];
    chromium.last = 0;
    let text = '';
    chromium.process.stdio[4].setEncoding('utf8').on('data', data => {
      const messages = (text + data).split('\0');
      text = messages.pop();
      messages.forEach(message => chromium.#receive(JSON.parse(message)));
    });
    const { targetId } = await chromium.#send('Target.createTarget', { url: 'about:blank' });
    ({ sessionId: chromium.session } = await chromium.#send('Target.attachToTarget', { targetId, flatten: true }));
    return chromium;
  }

  #receive({ id, method, params, result, error }) {
    if (method) this.listeners.forEach(listener => listener(method, params));
    const { resolve, reject } = this.waiting.get(id) ?? {};
    this.waiting.delete(id);
    if (error) reject?.(new Error(error.message));
    else resolve?.(result);
  }

  #send(method, params = {}) {
    const id = ++this.last;
    const message = { id, method, params, sessionId: this.session };
    this.process.stdio[3].write(JSON.stringify(message) + '\0');
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  /** A command of the protocol to the page. */
  send(method, params) { return this.#send(method, params); }

  /** `listener` hears all events. */
  on(listener) { this.listeners.push(listener); }

  /** The value of an expression, or of its promise, in the page. */
  async value(expression) {
    const { result, exceptionDetails } = await this.#send('Runtime.evaluate',
      { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  /** Waits until an expression is true. */
  async until(expression, seconds = 60) {
    const end = Date.now() + 1e3 * seconds;
    while (!await this.value(expression)) {
      if (Date.now() > end) throw new Error(`not after ${seconds} s: ${expression}\nthe page: ${await this.value('document.body.innerText.slice(0, 2000)')}`);
      await new Promise(resolve => setTimeout(resolve, 20));
    }
  }

  async end() {
    const closed = new Promise(resolve => this.process.once('exit', resolve));
    await this.#send('Browser.close').catch(() => {});
    await closed;
  }
}

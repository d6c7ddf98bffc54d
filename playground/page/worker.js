'use strict';

// Runs the program, once for each message. Of the system interface WASI (preview 1) it has the streams, the
// clock and random numbers; there are no files, so everything else is answered with an error.

const BAD_DESCRIPTOR = 8;
const NO_SUCH_CALL = 52;

class Exit {
  constructor(code) { this.code = code; }
}

/** Joins arrays of bytes. */
function joined(parts) {
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

/** The calls of WASI for one run. `line` takes each line that the program writes to standard error. */
function system(args, input, line) {
  const words = args.map(word => new TextEncoder().encode(word + '\0'));
  const output = [];
  const decoder = new TextDecoder();
  let memory, read = 0, pending = '';
  const view = () => new DataView(memory.buffer);
  const bytes = (at, length) => new Uint8Array(memory.buffer, at, length);

  /** Calls `each` with the buffers of a vector of them; returns the bytes that were moved. */
  function vector(at, count, each) {
    let moved = 0;
    for (let i = 0; i < count; i++) {
      moved += each(bytes(view().getUint32(at + 8 * i, true), view().getUint32(at + 8 * i + 4, true)));
    }
    return moved;
  }

  function said(text) {
    const lines = (pending + text).split('\n');
    pending = lines.pop();
    lines.forEach(line);
  }

  const calls = {
    args_sizes_get(count, size) {
      view().setUint32(count, words.length, true);
      view().setUint32(size, joined(words).length, true);
      return 0;
    },
    args_get(pointers, at) {
      for (const word of words) {
        view().setUint32(pointers, at, true);
        bytes(at, word.length).set(word);
        pointers += 4;
        at += word.length;
      }
      return 0;
    },
    environ_sizes_get(count, size) {
      view().setUint32(count, 0, true);
      view().setUint32(size, 0, true);
      return 0;
    },
    environ_get: () => 0,
    fd_prestat_get: () => BAD_DESCRIPTOR,
    fd_read(descriptor, at, count, result) {
      if (descriptor !== 0) return BAD_DESCRIPTOR;
      view().setUint32(result, vector(at, count, buffer => {
        const part = input.subarray(read, read + buffer.length);
        buffer.set(part);
        read += part.length;
        return part.length;
      }), true);
      return 0;
    },
    fd_write(descriptor, at, count, result) {
      if (descriptor !== 1 && descriptor !== 2) return BAD_DESCRIPTOR;
      view().setUint32(result, vector(at, count, buffer => {
        if (descriptor === 1) output.push(buffer.slice());
        else said(decoder.decode(buffer.slice(), { stream: true }));
        return buffer.length;
      }), true);
      return 0;
    },
    clock_time_get(_clock, _precision, result) {
      view().setBigUint64(result, BigInt(Math.round(performance.now() * 1e6)), true);
      return 0;
    },
    random_get(at, length) {
      for (let done = 0; done < length; done += 65536) {
        crypto.getRandomValues(bytes(at + done, Math.min(65536, length - done)));
      }
      return 0;
    },
    proc_exit(code) { throw new Exit(code); },
  };
  return { calls, attach: exported => { memory = exported; }, output: () => joined(output) };
}

/** Runs the program on `input`; returns the JSON of its answer and the samples after it. */
function run(module, args, input, line) {
  const { calls, attach, output } = system(['playground', ...args], input, line);
  const imports = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) {
    (imports[from] ??= {})[name] = calls[name] ?? (() => NO_SUCH_CALL);
  }
  const { exports } = new WebAssembly.Instance(module, imports);
  attach(exports.memory);
  try {
    exports._start();
  } catch (problem) {
    if (!(problem instanceof Exit && problem.code === 0)) throw problem;
  }
  const bytes = output();
  const end = bytes.indexOf(10);
  const answer = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)));
  return { answer, samples: new Float32Array(bytes.slice(end + 1).buffer) };
}

let program;

onmessage = ({ data }) => {
  if (data.module) {
    program = data.module;
    return;
  }
  const lines = [];
  const line = text => {
    lines.push(text);
    postMessage({ line: text });
  };
  try {
    const { answer, samples } = run(program, data.args, data.input, line);
    postMessage({ answer, samples }, [samples.buffer]);
  } catch (problem) {
    // What a program says that ends in a panic stands on standard error.
    postMessage({ failed: [...lines.slice(-4), String(problem.message ?? problem)].join('\n') });
  }
};

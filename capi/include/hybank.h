/* Runs filter banks that hybank designed: N slow channels in, one stream M times as fast out.
 *
 * A frame is one sample of each of the N channels; it gives M output samples. Of converters with rates of their own a
 * frame holds several samples each, in a row and converter after converter, and N counts all of them. Link with libhybank.a or libhybank.so.
 *
 *     hybank *bank = hybank_open("bank.json", "auto", 0);
 *     if (!bank) { puts(hybank_error()); return 1; }
 *     hybank_process(bank, input, frames, output);        frames * N samples in, frames * M out
 *     hybank_flush(bank, output);                          the last hybank_flush_frames(bank) * M samples
 *     hybank_close(bank);
 *
 * One thread at a time may use a bank; different banks are independent. Only open, close and
 * failures allocate. Whether the recursion of a bank is stable is not looked at here: `hybank design` writes stable banks alone,
 * and `hybank verify` proves it of any file.
 *
 * Plain C of 1989 with the types of stdint.h, so that MATLAB's loadlibrary and cffi can read it. pycparser does, in a test;
 * it was not tried in MATLAB itself.
 */
#ifndef HYBANK_H
#define HYBANK_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A bank with the state of one stream. */
typedef struct hybank hybank;

/* Reads a bank file. algorithm: "auto" (direct: no added latency), "direct" or "overlap-save". Sums are in double
 * precision if double_sums is not 0; recursive banks always use double. NULL on failure. */
hybank *hybank_open(const char *path, const char *algorithm, int double_sums);

/* Ends a bank; NULL is ignored. */
void hybank_close(hybank *bank);

size_t hybank_channels(const hybank *bank);      /* N, samples per frame */
size_t hybank_ratio(const hybank *bank);         /* M */
size_t hybank_latency(const hybank *bank);       /* output sample n belongs to fast sample n - latency */
size_t hybank_flush_frames(const hybank *bank);  /* frames of zeros that bring out the last samples */

/* Filters frames: channel i of frame k at input[k * N + i], its outputs at output[k * M] to output[k * M + M - 1].
 * Returns the samples written, frames * M, or -1 on failure. 16-bit samples have full scale 1; outputs saturate. */
ptrdiff_t hybank_process(hybank *bank, const float *input, size_t frames, float *output);
ptrdiff_t hybank_process_double(hybank *bank, const double *input, size_t frames, double *output);
ptrdiff_t hybank_process_int16(hybank *bank, const int16_t *input, size_t frames, int16_t *output);

/* The last samples, by zeros for input: hybank_flush_frames(bank) * M of them. Returns their number or -1. */
ptrdiff_t hybank_flush(hybank *bank, float *output);
ptrdiff_t hybank_flush_double(hybank *bank, double *output);
ptrdiff_t hybank_flush_int16(hybank *bank, int16_t *output);

/* Back to the beginning. */
void hybank_reset(hybank *bank);

/* What the last failure of this thread was, with the remedy; valid until its next failure. Never NULL. */
const char *hybank_error(void);

#ifdef __cplusplus
}
#endif

#endif

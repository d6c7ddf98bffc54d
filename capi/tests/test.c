/* Drives the library from C: integer taps and samples against their sum in integers, cuts into calls, refusals. */
#include "hybank.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 3, M = 2, TAPS = 10, LATENCY = 5, FRAMES = 4001, FLUSH = (LATENCY + M - 1) / M };

static int failures;
static int taps[N][TAPS];
static int16_t input[FRAMES + FLUSH][N], output[FRAMES + FLUSH][M];

static void check(int holds, const char *what) {
    if (!holds) {
        failures++;
        printf("FAILED: %s (%s)\n", what, hybank_error());
    }
}

/* A small generator, so that every run has the same numbers. */
static int drawn(int most) {
    static uint32_t state = 2007;
    state = state * 1664525u + 1013904223u;
    return (int)(state >> 16) % (2 * most + 1) - most;
}

static void write_bank(const char *path) {
    FILE *file = fopen(path, "w");
    fprintf(file, "{\"format\": \"hybank-bank\", \"version\": 1, \"fast_period\": 1.0, \"ratio\": %d, ", M);
    fprintf(file, "\"latency\": %d, \"method\": \"fir\", \"channels\": [", LATENCY);
    for (int i = 0; i < N; i++) {
        fprintf(file, "%s{\"delay\": 0.0, \"taps\": [", i ? ", " : "");
        for (int n = 0; n < TAPS; n++) fprintf(file, "%s%d.0", n ? ", " : "", taps[i][n] = drawn(9));
        fprintf(file, "]}");
    }
    fprintf(file, "], \"gamma\": {\"norm\": null, \"upper\": null, \"lower\": null, \"noncausal\": null}}\n");
    fclose(file);
}

/* y[kM + p] = sum over i and j of f_i[p + jM] x_i[k - j], saturated. */
static int definition(int k, int p) {
    long sum = 0;
    for (int i = 0; i < N; i++)
        for (int j = 0; p + j * M < TAPS && j <= k; j++) sum += (long)taps[i][p + j * M] * input[k - j][i];
    return sum > 32767 ? 32767 : sum < -32768 ? -32768 : (int)sum;
}

static int different(void) {
    int count = 0;
    for (int k = 0; k < FRAMES + FLUSH; k++)
        for (int p = 0; p < M; p++) count += output[k][p] != definition(k, p);
    return count;
}

static void integers(hybank *bank, const char *name) {
    int first = 0, sizes[] = {1, 2, 63, 64, 1000, FRAMES}, turn = 0;
    memset(output, 0, sizeof output);
    hybank_reset(bank);
    while (first < FRAMES) {
        int frames = sizes[turn++ % 6];
        if (frames > FRAMES - first) frames = FRAMES - first;
        check(hybank_process_int16(bank, input[first], frames, output[first]) == frames * M, name);
        first += frames;
    }
    check(hybank_flush_int16(bank, output[FRAMES]) == FLUSH * M, "flush");
    int wrong = different();
    printf("%s: %d of %d samples differ\n", name, wrong, (FRAMES + FLUSH) * M);
    check(wrong == 0, name);
}

static void floats(hybank *bank) {
    static float x[FRAMES][N], y[FRAMES][M];
    static double wide[FRAMES][N], z[FRAMES][M];
    int wrong = 0;
    for (int k = 0; k < FRAMES; k++)
        for (int i = 0; i < N; i++) wide[k][i] = x[k][i] = (float)(input[k][i] % 100);
    hybank_reset(bank);
    check(hybank_process(bank, x[0], FRAMES, y[0]) == FRAMES * M, "floats");
    hybank_reset(bank);
    check(hybank_process_double(bank, wide[0], FRAMES, z[0]) == FRAMES * M, "doubles");
    for (int k = 0; k < FRAMES; k++)
        for (int p = 0; p < M; p++) {
            double sum = 0;
            for (int i = 0; i < N; i++)
                for (int j = 0; p + j * M < TAPS && j <= k; j++) sum += taps[i][p + j * M] * wide[k - j][i];
            wrong += y[k][p] != (float)sum || z[k][p] != sum;
        }
    check(wrong == 0, "whole numbers in floats are exact");
}

static void refusals(const char *path, hybank *bank) {
    float x[N] = {0}, y[M];
    check(!hybank_open("no/such/bank.json", "auto", 0) && strstr(hybank_error(), "no/such/bank.json"), "no file");
    check(!hybank_open(path, "fft", 0) && strstr(hybank_error(), "choose auto"), "unknown algorithm");
    check(!hybank_open(NULL, "auto", 0) && strstr(hybank_error(), "NULL"), "no path");
    check(hybank_process(NULL, x, 1, y) == -1 && strstr(hybank_error(), "hybank_open"), "no bank");
    check(hybank_process(bank, NULL, 1, y) == -1 && strstr(hybank_error(), "input"), "no input");
    check(hybank_process(bank, x, 1, NULL) == -1 && strstr(hybank_error(), "output"), "no output");
    check(hybank_process(bank, x, SIZE_MAX / 2, y) == -1 && strstr(hybank_error(), "memory"), "too many");
    check(hybank_process(bank, NULL, 0, NULL) == 0, "no frames need no arrays");
    check(hybank_channels(NULL) == 0, "NULL has no channels");
    hybank_close(NULL);
}

int main(int count, char **arguments) {
    const char *path = count > 1 ? arguments[1] : "bank.json";
    const char *algorithms[] = {"auto", "direct"};
    write_bank(path);
    for (int k = 0; k < FRAMES; k++)
        for (int i = 0; i < N; i++) input[k][i] = (int16_t)(k < 2000 ? drawn(300) : drawn(1 << 14));
    for (int a = 0; a < 2; a++) {
        hybank *bank = hybank_open(path, algorithms[a], a);
        check(bank != NULL, "open");
        if (!bank) return 1;
        check(hybank_channels(bank) == N && hybank_ratio(bank) == M, "shape");
        check(hybank_latency(bank) == LATENCY && hybank_flush_frames(bank) == FLUSH, "latency");
        integers(bank, algorithms[a]);
        floats(bank);
        refusals(path, bank);
        hybank_close(bank);
    }
    printf("%s\n", failures ? "some checks failed" : "all checks hold");
    return failures != 0;
}

/* A host that attacks an exported planner: stress STEPS SEED [ONLY]. Random starts along the sample road, some far off,
 * driven a while with disturbances, and begun anew. Looks at what every step has promised; prints one line of counts.
 * ONLY is the number of a step that a counter of instructions should see alone. Exits with 1 for a broken promise; a
 * step that allocates ends the program.
 */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sample.h"
#include "simulate.h"

#ifdef WATCHED
#include <valgrind/callgrind.h>
#include <valgrind/memcheck.h>
#else
#define CALLGRIND_START_INSTRUMENTATION
#define CALLGRIND_STOP_INSTRUMENTATION
#define CALLGRIND_ZERO_STATS
#define VALGRIND_MAKE_MEM_UNDEFINED(at, size) ((void)(at), (void)(size))
#endif

enum { DRIVEN = 40, TRAPPED = 70 };

static const double bounds_kept = 1e-6; /* the solver's, of curvatures and their changes */

static struct hdvplan_memory memory;
static volatile int armed; /* while a step runs */

/* The linker's --wrap leads every call of an allocator to these. */
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void __real_free(void *old);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);
void __wrap_free(void *old);

static void spring(void) {
    if (armed)
        _Exit(TRAPPED);
}
void *__wrap_malloc(size_t size) {
    spring();
    return __real_malloc(size);
}
void *__wrap_calloc(size_t count, size_t size) {
    spring();
    return __real_calloc(count, size);
}
void *__wrap_realloc(void *old, size_t size) {
    spring();
    return __real_realloc(old, size);
}
void __wrap_free(void *old) {
    spring();
    __real_free(old);
}

struct tally {
    long steps, ended[HDVPLAN_BEYOND + 1], most[2], at[2], broken, solves;
    double deepest;
};

static double uniform(double low, double high) {
    static uint64_t state; /* splitmix64 */
    static int begun;
    if (!begun) {
        begun = 1;
        state = (uint64_t)low;
        return 0.0;
    }
    uint64_t z = (state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return low + (high - low) * ((double)((z ^ (z >> 31)) >> 11) * 0x1p-53);
}

/* Say what a step has broken. */
static void wrong(struct tally *tally, const char *what) {
    tally->broken++;
    fprintf(stderr, "step %ld: %s\n", tally->steps, what);
}

/* Whether something steered lies within its limit, and within what it can change by from before. */
static int within(int64_t number, double value, double before) {
    return fabs(value) <= hdvplan_vehicle.most[number] + bounds_kept &&
           fabs(value - before) <= hdvplan_vehicle.change[number] + bounds_kept;
}

/* Whether all of the motion is finite, and its curvature and wheels are steered as the vehicle can. */
static void look(struct tally *tally, double kappa) {
    int finite = isfinite(memory.planner.violation) != 0, can = 1;
    for (int64_t i = 0; i <= STAGES; i++) {
        const double *z = hdvplan_motion(&memory, i), *before = hdvplan_motion(&memory, i > 0 ? i - 1 : 0);
        for (int64_t j = 0; j < STATES + (i < STAGES); j++)
            finite &= isfinite(z[j]) != 0;
        for (int64_t wheel = 1; wheel <= WHEELS; wheel++)
            can &= within(wheel, z[STATES - WHEELS + wheel - 1], before[STATES - WHEELS + wheel - 1]);
        if (i < STAGES)
            can &= within(0, z[STATES], i > 0 ? before[STATES] : kappa);
    }
    if (!finite)
        wrong(tally, "not finite");
    if (!can)
        wrong(tally, "more than the vehicle can steer");
}

static void note(struct tally *tally, int64_t took, int number) {
    if (took > tally->most[number]) {
        tally->most[number] = took;
        tally->at[number] = tally->steps;
    }
}

/* Work arrays hold nothing from step to step: a checker of memory may take them for never written. */
static void forget(void) {
    VALGRIND_MAKE_MEM_UNDEFINED(memory.work, sizeof memory.work);
    VALGRIND_MAKE_MEM_UNDEFINED(memory.weights, sizeof memory.weights);
    VALGRIND_MAKE_MEM_UNDEFINED(memory.steps, sizeof memory.steps);
    VALGRIND_MAKE_MEM_UNDEFINED(memory.before, sizeof memory.before);
    VALGRIND_MAKE_MEM_UNDEFINED(&memory.sides, sizeof memory.sides);
    VALGRIND_MAKE_MEM_UNDEFINED(memory.member, sizeof memory.member);
}

static enum hdvplan_status
plan(struct tally *tally, int64_t station, const double *state, double kappa, long only) {
    forget();
    if (tally->steps == only) {
        CALLGRIND_START_INSTRUMENTATION;
        CALLGRIND_ZERO_STATS;
    }
    armed = 1;
    enum hdvplan_status status = hdvplan_step(&memory, station, state, kappa);
    armed = 0;
    if (tally->steps == only)
        CALLGRIND_STOP_INSTRUMENTATION;
    const struct hdv_planner *planner = &memory.planner;
    tally->ended[status]++;
    if (status != HDVPLAN_BEYOND) {
        tally->solves += (long)planner->iterations;
        note(tally, planner->iterations, 0);
        note(tally, planner->linearisations, 1);
        if (planner->iterations > planner->most_factorisations)
            wrong(tally, "more factorisations than the budget");
        if (planner->linearisations > planner->most_linearisations)
            wrong(tally, "more linearisations than the budget");
        look(tally, kappa);
        tally->deepest = fmax(tally->deepest, planner->violation);
    }
    tally->steps++;
    return status;
}

static double clipped(int64_t number, double value) {
    double most = hdvplan_vehicle.most[number];
    return fmax(-most, fmin(most, value));
}

/* Change a state by up to so much beside the road, and of every angle. No wheel is turned further than it can be. */
static void disturb(double *state, double aside, double turned) {
    for (int64_t j = 0; j < STATES; j++)
        state[j] += j == 0 ? uniform(-aside, aside) : uniform(-turned, turned);
    for (int64_t wheel = 1; wheel <= WHEELS; wheel++)
        state[STATES - WHEELS + wheel - 1] = clipped(wheel, state[STATES - WHEELS + wheel - 1]);
}

/* A state near the road's stationary geometry, at a random scale. */
static double start(int64_t station, double *state) {
    const double scales[] = {0.0, 0.1, 0.3, 1.0}, scale = scales[(int)uniform(0.0, 4.0)];
    memcpy(state, sample_road.states + station * STATES, STATES * sizeof(double));
    disturb(state, 2.0 * scale, 0.4 * scale);
    return clipped(0, sample_road.curvatures[station] + scale * uniform(-0.1, 0.1));
}

/* Drive the plan's first steps; returns whether the model holds until their end. */
static int drive(int64_t station, double *state) {
    double kappa[EXECUTED], wheels[(EXECUTED + 1) * (WHEELS + 1)], states[(EXECUTED + 1) * STATES];
    for (int64_t i = 0; i <= EXECUTED; i++) {
        const double *z = hdvplan_motion(&memory, i);
        if (i < EXECUTED)
            kappa[i] = z[STATES];
        memcpy(wheels + i * WHEELS, z + STATES - WHEELS, WHEELS * sizeof(double));
    }
    memcpy(states, state, STATES * sizeof(double));
    hdv_simulate(
        hdvplan_vehicle.units, UNITS, STATES, &sample_road.curve, sample_road.stations[station].s, EXECUTED, STEP_M,
        kappa, wheels, 1, 10, states
    );
    memcpy(state, states + EXECUTED * STATES, STATES * sizeof(double));
    int holds = 1;
    for (int64_t j = 0; j < STATES; j++)
        holds &= isfinite(state[j]) != 0;
    return holds;
}

/* One drive from a random start, with a disturbance at one step in ten. */
static void episode(struct tally *tally, long steps, long only) {
    double state[STATES];
    int64_t last = sample_stations - EXECUTED, station = (int64_t)uniform(0.0, (double)last);
    double kappa = start(station, state);
    if (uniform(0.0, 1.0) < 0.5)
        hdvplan_begin(&memory, &sample_road);
    for (int i = 0; i < DRIVEN && station < last && tally->steps < steps; i++) {
        if (plan(tally, station, state, kappa, only) == HDVPLAN_BEYOND || !drive(station, state))
            return;
        kappa = hdvplan_motion(&memory, EXECUTED - 1)[STATES];
        station += EXECUTED;
        if (uniform(0.0, 1.0) < 0.1)
            disturb(state, 0.2, 0.03);
    }
}

int main(int count, char **words) {
    if (count < 3 || !hdvplan_begin(&memory, &sample_road))
        return 2;
    long steps = atol(words[1]), only = count > 3 ? atol(words[3]) : -1;
    if (only == -2) { /* shows that the trap springs */
        void *volatile taken; /* no compiler leaves the call out */
        armed = 1;
        taken = malloc(1);
        free(taken);
    }
    uniform(atof(words[2]), 0.0);
    struct tally tally = {0};
    struct timespec now;
    while (tally.steps < steps && (only < 0 || tally.steps <= only))
        episode(&tally, steps, only);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    printf(
        "%ld,%ld,%ld,%ld,%ld,%ld,%ld,%ld,%ld,%ld,%ld,%.4f,%.3f\n", tally.steps, tally.ended[0], tally.ended[1],
        tally.ended[2], tally.ended[3], tally.solves, tally.most[0], tally.most[1], tally.at[0], tally.at[1],
        tally.broken, tally.deepest, (double)now.tv_sec + 1e-9 * (double)now.tv_nsec
    );
    return tally.broken > 0;
}

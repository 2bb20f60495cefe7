/* Drives the sample road: plan, drive EXECUTED steps of the plan as an exact simulation, plan again. Prints what was
 * driven, one station a line, and on standard error what it took. */
#include <stdio.h>
#include <string.h>

#include "sample.h"
#include "simulate.h"

static struct hdvplan_memory memory; /* the host's: here one planner */

/* What the drive took. */
struct tally {
    int64_t plans, programs, factorisations, most_factorisations, linearisations, most_linearisations;
    int64_t ended[HDVPLAN_BEYOND + 1]; /* plans by status */
    double deepest;                    /* predicted breach [m] */
};

static void count(struct tally *tally, const struct hdv_planner *planner, enum hdvplan_status status) {
    tally->plans++;
    tally->ended[status]++;
    tally->programs += planner->programs;
    tally->factorisations += planner->iterations;
    tally->linearisations += planner->linearisations;
    if (planner->iterations > tally->most_factorisations)
        tally->most_factorisations = planner->iterations;
    if (planner->linearisations > tally->most_linearisations)
        tally->most_linearisations = planner->linearisations;
    if (planner->violation > tally->deepest)
        tally->deepest = planner->violation;
}

/* Drive the plan's first steps from a state; states (EXECUTED + 1, STATES) get what is passed. */
static void simulate(int64_t station, int64_t steps, const double *state, double *states) {
    double kappa[EXECUTED], wheels[(EXECUTED + 1) * (WHEELS + 1)];
    for (int64_t i = 0; i <= steps; i++) {
        const double *z = hdvplan_motion(&memory, i);
        if (i < steps)
            kappa[i] = z[STATES];
        memcpy(wheels + i * WHEELS, z + STATES - WHEELS, WHEELS * sizeof(double));
    }
    memcpy(states, state, STATES * sizeof(double));
    hdv_simulate(
        hdvplan_vehicle.units, UNITS, STATES, &sample_road.curve, sample_road.stations[station].s, steps, STEP_M, kappa,
        wheels, 1, 10, states
    );
}

static void print_header(void) {
    printf("s,e_y,e_psi");
    for (int64_t j = 2; j < STATES; j++)
        printf(j <= UNITS ? ",beta%ld" : ",steering%ld", (long)(j <= UNITS ? j - 1 : j - UNITS));
    printf(",kappa\n");
}

static void print_station(int64_t station, const double *state, double kappa) {
    printf("%.17g", sample_road.stations[station].s);
    for (int64_t j = 0; j < STATES; j++)
        printf(",%.17g", state[j]);
    printf(",%.17g\n", kappa);
}

static void print_tally(const struct tally *tally) {
    fprintf(stderr, "memory: %lu bytes\n", (unsigned long)sizeof memory);
    fprintf(
        stderr, "%ld plans: %ld done, %ld with the budget spent, %ld kept, %ld beyond the model\n", (long)tally->plans,
        (long)tally->ended[HDVPLAN_DONE], (long)tally->ended[HDVPLAN_SPENT], (long)tally->ended[HDVPLAN_KEPT],
        (long)tally->ended[HDVPLAN_BEYOND]
    );
    fprintf(
        stderr, "programs: %ld; factorisations: %ld, at most %ld a plan; linearisations: %ld, at most %ld a plan\n",
        (long)tally->programs, (long)tally->factorisations, (long)tally->most_factorisations,
        (long)tally->linearisations, (long)tally->most_linearisations
    );
    fprintf(stderr, "deepest predicted breach: %.4f m\n", tally->deepest);
}

int main(void) {
    struct tally tally = {0};
    double state[STATES], states[(EXECUTED + 1) * STATES], kappa = sample_kappa;
    if (!hdvplan_begin(&memory, &sample_road)) {
        fprintf(stderr, "error: vehicle.h was made for another core\n");
        return 2;
    }
    memcpy(state, sample_start, sizeof state);
    print_header();
    for (int64_t station = 0; station < sample_stations;) {
        int64_t steps = sample_stations - station < EXECUTED ? sample_stations - station : EXECUTED;
        enum hdvplan_status status = hdvplan_step(&memory, station, state, kappa);
        count(&tally, &memory.planner, status);
        if (status == HDVPLAN_BEYOND) {
            fprintf(stderr, "error: no plan from s = %.1f m\n", sample_road.stations[station].s);
            return 1;
        }
        simulate(station, steps, state, states);
        for (int64_t i = 0; i < steps; i++)
            print_station(station + i, states + i * STATES, hdvplan_motion(&memory, i)[STATES]);
        memcpy(state, states + steps * STATES, sizeof state);
        kappa = hdvplan_motion(&memory, steps - 1)[STATES];
        station += steps;
    }
    print_station(sample_stations, state, kappa);
    print_tally(&tally);
    return 0;
}

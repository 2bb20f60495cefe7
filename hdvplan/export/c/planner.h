/* The planner of one vehicle on its own computer: one struct of memory, and what the host calls.
 *
 * Nothing here allocates, does I/O, recurses or keeps a global that is written. The vehicle, its settings and all sizes
 * are constants in vehicle.h and vehicle.c, the road is a table that the host refreshes. SI units, radians; left of the
 * road is positive. README.md says what to call when.
 */
#ifndef HDVPLAN_PLANNER_H
#define HDVPLAN_PLANNER_H

#include "step.h"
#include "terms.h"
#include "vehicle.h"

/* A road as tables, sampled every STEP_M metres of arclength. The curve reaches beyond the first and the last station
 * as far as the vehicle does, and one horizon further. */
struct hdvplan_road {
    struct hdv_curve curve;
    const struct hdv_station *stations;   /* (count,) */
    const double *states;                 /* (count, STATES), the road's stationary geometry */
    const double *curvatures;             /* (count,), the same [1/m] */
    const struct hdv_residual *residuals; /* (count,), of the objective */
    const double *angles;                 /* (count, WHEELS), wanted angles of the wheels that the plan steers [rad] */
    int64_t count;                        /* a plan from station i needs STAGES more */
    struct hdv_street street;             /* without pieces: no limits */
};

/* How a step has ended. */
enum hdvplan_status {
    HDVPLAN_DONE,  /* a plan, and every program was solved */
    HDVPLAN_SPENT, /* the budget is spent: the best motion so far, which keeps the dynamics and the steering's limits */
    HDVPLAN_KEPT,  /* a program could not be solved: the last plan, driven on from where the vehicle is */
    HDVPLAN_BEYOND /* the table has no horizon from this station on, or the state lies outside the model: no plan */
};

/* What of a vehicle's terms and planner is constant: records without their addresses. */
struct hdvplan_vehicle {
    const struct hdv_unit *units;
    struct hdv_planner planner;
    struct hdv_dynamics dynamics;
    struct hdv_centring centring;
    struct hdv_steering steering;
    struct hdv_limits limits;
    const double *most, *change; /* (1 + WHEELS,), of the curvature, then of the wheels; and from station to station */
    const double *behind;        /* (UNITS,), of every axle behind the lead rear axle on a straight [m] */
    const double *stage;         /* (STAGE,), what a stage's record begins with */
    const double *rows;          /* (ROWS, ROW), the same of its rows */
    const int64_t *bounded;      /* (BOUNDED,), the states with bounds */
    double tolerance;            /* of the solver [m] */
};

extern const struct hdvplan_vehicle hdvplan_vehicle;

/* Numbers of the core's records, see sizes.h and riccati.h; hdvplan_begin compares them. */
enum {
    COUNT = STAGES + 1,
    SIDES = ROWS + 2 * (BOUNDED + INPUTS),
    STAGE = 2 * COLUMNS * COLUMNS + COLUMNS * INPUTS + 2 * COLUMNS + INPUTS * INPUTS + 3 * INPUTS + 1 + 2 * BOUNDED,
    ROW = COLUMNS + 3,
    POINT = 2 * COLUMNS + 2 * INPUTS + BOUNDED,
    RECURSION = COLUMNS * COLUMNS + COLUMNS + INPUTS * COLUMNS + INPUTS + INPUTS * INPUTS,
    WEIGHTS = COLUMNS * COLUMNS + COLUMNS + INPUTS * INPUTS + INPUTS,
    MORE = 4 /* numbers behind an array that vectors.h may read, and room where there are no rows */
};

/* All memory of a planner. */
struct hdvplan_memory {
    struct hdv_planner planner;
    struct hdv_scene scene;
    struct hdv_solver solver;
    struct hdv_dynamics dynamics;
    struct hdv_centring centring;
    struct hdv_steering steering;
    struct hdv_limits limits;
    struct hdv_term terms[4];
    struct hdv_array arrays[HDV_OWN_ARRAYS + 3];
    int64_t table_count; /* stations of the road's tables */
    /* of the program, by stage */
    double stages[COUNT * STAGE + MORE], rows[COUNT * ROWS * ROW + MORE], first[COLUMNS];
    double points[COUNT * POINT + MORE], row_points[COUNT * ROWS * 2 + MORE];
    /* of the motion */
    double motion[COUNT * (STATES + 1)], before[COUNT * (STATES + 1)], start[STATES], priced[1 + UNITS];
    struct hdv_pose poses[COUNT * UNITS];
    /* of the terms */
    struct hdv_centred centred[COUNT];
    double ones[COUNT];
    double seen[COUNT * (STATES + 2)];
    struct hdv_edge edges[COUNT * UNITS * 2];
    struct hdv_near near;
    /* of the solver */
    double work[COUNT * RECURSION + MORE], weights[COUNT * WEIGHTS + MORE], steps[COUNT * (COLUMNS + INPUTS) + MORE];
    union {
        struct hdv_inequality inequalities[COUNT * SIDES]; /* of the active set, */
        struct hdv_pair pairs[COUNT * SIDES + 1];          /* of the interior point, which begins when that has ended */
    } sides;
    uint8_t member[COUNT * SIDES];
};

/* Prepares the memory for a drive along a road, whose tables must stay; the first plan starts cold. Returns 0 where
 * vehicle.h was made for another core. */
int hdvplan_begin(struct hdvplan_memory *memory, const struct hdvplan_road *road);

/* Exchanges the tables, of which the first ``dropped`` stations are gone: at most those before the last plan, which
 * stays known. Arclengths stay. */
void hdvplan_refresh(struct hdvplan_memory *memory, const struct hdvplan_road *road, int64_t dropped);

/* Plans one horizon from a state (STATES,) at a station: e_y [m], e_psi, articulation angles, wheel angles [rad].
 * kappa_before is the curvature that was driven until there [1/m]. hdvplan_motion has the plan. */
enum hdvplan_status
hdvplan_step(struct hdvplan_memory *memory, int64_t station, const double *state, double kappa_before);

/* The planned state at a stage 0..STAGES; behind its STATES numbers the curvature that is held from there on [1/m]. */
const double *hdvplan_motion(const struct hdvplan_memory *memory, int64_t stage);

#endif

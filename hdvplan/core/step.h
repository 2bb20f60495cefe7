/* One planning step: linearise at the last plan, solve the program, move. Once for RTI, to convergence for SQP.
 *
 * RTI is the real-time iteration, SQP sequential quadratic programming. A step is halved as long as it does not improve
 * the motion, and an RTI plan that would break a limit gets a few programs more: neither happens on a road with room,
 * where RTI is one program a step.
 */
#ifndef HDVPLAN_STEP_H
#define HDVPLAN_STEP_H

#include "hdvplan.h"
#include "residuals.h"
#include "solver.h"

/* An array with one record a station. All of them are windows of the drive: a plan's stage i stands at record at + i,
 * and nothing moves from step to step. Where the window reaches the arrays' end, it is moved back to their beginning.
 */
struct hdv_array {
    void *base;
    int64_t size; /* of a record [bytes] */
};

/* The arrays that every planner has come first, in this order; those of the terms follow. */
enum { HDV_STAGES, HDV_ROWS, HDV_MOTION, HDV_POSES, HDV_POINTS, HDV_ROW_POINTS, HDV_OWN_ARRAYS };

/* What ends a call: a plan; a program that waits for a solution, or that our solver failed at; a point without foot. */
enum hdv_stop { HDV_PLANNED, HDV_SOLVE, HDV_REFUSED, HDV_LOST };

/* What is wrong with a solution: it breaks the program; it keeps it, but is far from its optimum. */
enum hdv_judgement { HDV_FINE, HDV_BROKEN, HDV_FAR };

/* A planner of one vehicle along one drive. */
struct hdv_planner {
    struct hdv_scene *scene; /* of the present step */
    const struct hdv_array *arrays;
    int64_t array_count;
    int64_t capacity; /* records of every array */
    int64_t origin;   /* station of their first record */
    const struct hdv_term *terms;
    int64_t term_count;
    struct hdv_solver *solver;          /* ours, or NULL: the caller solves */
    const struct hdv_station *stations; /* of the whole drive */
    const double *states;               /* (stations, states), the road's stationary geometry */
    const double *curvatures;           /* (stations,) [1/m] */
    const double *most;                 /* of the curvature, then of every wheel that the plan steers [1/m, rad] */
    const double *change;               /* the same, from station to station */
    int64_t wheels;                     /* how many the plan steers */
    double *start;                      /* (states,), where this plan begins */
    double *weights;                    /* (bodies' states,), largest multiplier of each state's dynamics */
    double *before;                     /* (N+1, states + 1), the motion before a step */
    int64_t rounds;                     /* most programs of a plan that iterates */
    int64_t repairs;                    /* most further programs of an RTI plan that would break a limit */
    int64_t executed;                   /* stages that are driven before the next plan */
    int64_t converges;                  /* 1: SQP */
    double tolerance;                   /* a plan that iterates ends when no state moves further [m, rad] */
    int64_t most_factorisations;        /* of a step, over all its programs */
    int64_t most_linearisations;        /* of a step at the whole motion, which end with the best motion so far */
    /* what is known from step to step */
    int64_t last;    /* the last plan's first station, -1: none */
    int64_t binding; /* whether limits bind in the last program */
    int64_t guessed; /* whether the last solution helps with the next */
    int64_t reaches; /* the station up to which some program's solution was taken */
    /* this step */
    int64_t iterates;               /* 1: until convergence */
    int64_t lost;                   /* the stage with a point that has no foot, -1 */
    int64_t programs;               /* solved */
    int64_t iterations;             /* of our solver, over all programs */
    int64_t ending;                 /* of our solver, for the last program: enum hdv_ending */
    int64_t linearisations;         /* at the whole motion */
    int64_t spent;                  /* whether the step ended because its budget was spent */
    int64_t halvings;               /* how often a step was halved */
    int64_t usable;                 /* whether the last program's solution was taken */
    int64_t priced;                 /* whether the plan has a merit */
    double violation;               /* deepest predicted breach of a limit [m] */
    double moved;                   /* largest change of a state by the last program [m, rad] */
    double merit;                   /* of the planned motion, at the last program's weights */
    struct hdv_residuals residuals; /* of the last program, recomputed */
    double seconds_linearise, seconds_solve, seconds_check;
};

/* One step with our solver, from the state in planner->start at a station; ``kappa_before`` was held until there. */
HDV_EXPORT int64_t hdv_step(struct hdv_planner *planner, int64_t first, double kappa_before);

/* Whether e_y of the planned motion leaps within what is driven; it is then forgotten: the next plan starts cold. */
HDV_EXPORT int64_t hdv_leaps(struct hdv_planner *planner);

/* The motion that a step linearises at, and its merit. */
HDV_EXPORT int64_t hdv_guess_motion(
    const struct hdv_scene *scene, const double *start, const double *states, const double *curvatures, int64_t kept,
    const double *most, const double *change, int64_t wheels
);
HDV_EXPORT double hdv_take_step(const struct hdv_scene *scene, const struct hdv_point *solution, double share);
HDV_EXPORT int64_t
hdv_l1_weights(const struct hdv_program *program, const struct hdv_point *solution, int64_t count, double *weights);
HDV_EXPORT double hdv_defect_price(const struct hdv_program *program, int64_t count, const double *weights);

double seconds(void); /* on the wall, from an arbitrary moment on: how long the parts of a step take */

#endif

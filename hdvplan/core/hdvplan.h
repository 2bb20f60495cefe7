/* The records that planning, solving and judging share, and the functions that hdvplan/core.py calls.
 *
 * Frame: arclength s along the road [m], offset e_y to the left of it [m], heading error e_psi counter-clockwise [rad];
 * the plane has x east and y north [m]. Equation numbers are those of docs/maths.md, [GEO] and [ART] the papers named
 * there. Nothing here allocates, keeps a global or does I/O: the caller owns all memory. Sizes and indices are checked
 * in Python, once.
 */
#ifndef HDVPLAN_H
#define HDVPLAN_H

#include <stdint.h>

/* For functions that are called with literal sizes: see HDV_UNROLLED. */
#if defined(__GNUC__)
#define HDV_INLINE static inline __attribute__((always_inline))
#else
#define HDV_INLINE static inline
#endif

#if defined(_WIN32)
#define HDV_EXPORT __declspec(dllexport)
#else
#define HDV_EXPORT __attribute__((visibility("default")))
#endif

enum { HDV_MOST_UNITS = 16, HDV_MOST_STATES = 40, HDV_MOST_INPUTS = 20, HDV_POINTS_PER_EDGE = 6 };

/* A path as a table of quintic segments of equal arclength: six power coefficients of x, then of y, lowest first. */
struct hdv_curve {
    const double *coefficients; /* (segments, 12) */
    int64_t segments;
    double s_first; /* [m] */
    double spacing; /* [m] */
};

/* One rigid body. Lengths along its axis. */
struct hdv_unit {
    double wheelbase;          /* front axle, or coupling, to the axle [m] */
    double hitch_offset;       /* coupling of the next unit behind the axle [m] */
    double front;              /* of the body, ahead of the axle [m] */
    double rear_overhang;      /* [m] */
    double half_width;         /* [m] */
    double steering_ratio;     /* of the axle; one that the plan steers has -1, which passes its state on */
    double max_steering_angle; /* [rad] */
    int64_t steered_by;        /* number of the state that steers a trailer's axle */
};

/* Where a unit is in the plane: axle, heading, coupling to the unit ahead; and how it stands to what is ahead. */
struct hdv_pose {
    double x, y;                   /* of the axle [m] */
    double cos, sin;               /* of the heading */
    double coupling_x, coupling_y; /* to the unit ahead; of the lead unit its axle [m] */
    double turned_cos, turned_sin; /* of e_psi, or of the articulation angle */
};

/* What planning knows of the road where the lead axle is. */
struct hdv_station {
    double s;         /* [m] */
    double step;      /* to the next station [m]: negative where driven rear first, 0 where the vehicle stands */
    double x, y;      /* [m] */
    double cos, sin;  /* of the heading */
    double curvature; /* [1/m] */
    double curvature_between; /* half-way to the next station [1/m] */
    double room_left;     /* the narrowest reach that limits leave beside the vehicle [m]; infinite where none counts */
    double room_right;    /* [m] */
    double k_low, k_high; /* smallest and largest signed curvature beside the vehicle [1/m] */
    double
        margin; /* what a body may reach beyond the limits between stations when it keeps them at every station [m] */
    double give_way; /* by which limits give way to the plan where the lead axle is here [m] */
};

/* Sizes of a program in stages: N intervals, states and inputs of a stage, elastic rows, states with bounds. */
struct hdv_shape {
    int64_t stages;  /* N */
    int64_t states;  /* n */
    int64_t inputs;  /* m */
    int64_t rows;    /* p, of the stages 1..N */
    int64_t bounded; /* b */
};

/* One row g'x - sigma <= h: g (n,), h, linear and quadratic price of sigma. A stage's record is in sizes.h. */
struct hdv_program {
    struct hdv_shape shape;
    double *stages;         /* (N+1) records, see sizes.h */
    double *rows;           /* (N+1, p) records */
    const double *x_first;  /* (n,) */
    const int64_t *bounded; /* (b,), the states with bounds */
};

/* A primal-dual point: of a stage x (n), u (m), dynamics (n), bounds of x (b), of u (m); of a row sigma, multiplier. */
struct hdv_point {
    double *stages; /* (N+1) records */
    double *rows;   /* (N+1, p, 2) */
};

/* What a term's functions see of a planning step. Arrays of stages begin at its stage 0. */
struct hdv_scene {
    const struct hdv_unit *units;
    int64_t unit_count;
    int64_t states;                 /* of the vehicle: e_y, e_psi, articulation angles, wheel angles */
    const struct hdv_station *road; /* (N+1,), stations of the stages */
    double *motion;                 /* (N+1, states + 1): z, and kappa held until the next stage [1/m] */
    struct hdv_pose *poses;         /* (N+1, units) */
    struct hdv_program program;
    double step;         /* between stations, at most [m] */
    double kappa_before; /* held until stage 0 [1/m] */
    int64_t first;       /* station of stage 0 */
    int64_t at;          /* stage 0 in the memory of terms, which is indexed by station less the memory's origin */
    int64_t fixed;       /* stages that no later program can change */
    int64_t binding;     /* whether limits bind in the last program, or none was solved yet */
};

/* A term adds its linearisation at stages i >= begin >= 1 to the program; of the stages before only the first state has
 * changed. It returns -1, or a stage with a point of the vehicle that has no foot on the road. fresh: nothing is known
 * of these stages yet. Its price is its share of the merit, at the motion of the last linearisation. */
typedef int64_t hdv_linearise(void *data, const struct hdv_scene *scene, int64_t begin, int64_t fresh);
typedef double hdv_price(void *data, const struct hdv_scene *scene);

struct hdv_term {
    hdv_linearise *linearise;
    hdv_price *price;
    void *data;
    const double *violation; /* deepest breach by the motion last linearised [m]; NULL: no limit */
};

#endif

/* Puts the core together for one vehicle: see planner.h. */
#include "planner.h"

#include <math.h>
#include <string.h>

#include "riccati.h"
#include "sizes.h"

/* The core's clock, which only measures: here there is none. */
double seconds(void) {
    return 0.0;
}

static int sizes_agree(void) {
    return stage_size(COLUMNS, INPUTS, BOUNDED) == STAGE && point_size(COLUMNS, INPUTS, BOUNDED) == POINT &&
           recursion_size(COLUMNS, INPUTS) == RECURSION && weights_size(COLUMNS, INPUTS) == WEIGHTS;
}

/* Let the memory's records lead to each other. */
static void lay_out(struct hdvplan_memory *own) {
    const struct hdv_shape shape = {STAGES, COLUMNS, INPUTS, ROWS, BOUNDED};
    own->solver = (struct hdv_solver){
        .work = own->work,
        .weights = own->weights,
        .steps = own->steps,
        .inequalities = own->sides.inequalities,
        .pairs = own->sides.pairs,
        .member = own->member,
        .tolerance = hdvplan_vehicle.tolerance,
        .screens = 1,
        .warm = 1
    };
    own->scene = (struct hdv_scene){
        .units = hdvplan_vehicle.units,
        .unit_count = UNITS,
        .states = STATES,
        .program = {shape, own->stages, own->rows, own->first, hdvplan_vehicle.bounded},
        .step = STEP_M
    };
    const struct hdv_array arrays[] = {
        [HDV_STAGES] = {own->stages, STAGE * sizeof(double)},
        [HDV_ROWS] = {own->rows, ROWS * ROW * sizeof(double)},
        [HDV_MOTION] = {own->motion, (STATES + 1) * sizeof(double)},
        [HDV_POSES] = {own->poses, UNITS * sizeof(struct hdv_pose)},
        [HDV_POINTS] = {own->points, POINT * sizeof(double)},
        [HDV_ROW_POINTS] = {own->row_points, ROWS * 2 * sizeof(double)},
        [HDV_OWN_ARRAYS] = {own->centred, sizeof(struct hdv_centred)},
        [HDV_OWN_ARRAYS + 1] = {own->seen, (STATES + 2) * sizeof(double)},
        [HDV_OWN_ARRAYS + 2] = {own->edges, 2 * UNITS * sizeof(struct hdv_edge)}
    };
    memcpy(own->arrays, arrays, sizeof arrays);
}

/* Let the planner's record lead to the rest; its settings stay those of the vehicle. */
static void lay_out_planner(struct hdvplan_memory *own) {
    struct hdv_planner *planner = &own->planner;
    *planner = hdvplan_vehicle.planner;
    planner->scene = &own->scene;
    planner->arrays = own->arrays;
    planner->array_count = HDV_OWN_ARRAYS + (ROWS > 0 ? 3 : 1);
    planner->capacity = COUNT;
    planner->terms = own->terms;
    planner->solver = &own->solver;
    planner->most = hdvplan_vehicle.most;
    planner->change = hdvplan_vehicle.change;
    planner->start = own->start;
    planner->weights = own->priced;
    planner->before = own->before;
}

/* Give a program's records what they begin with. */
static void fill(struct hdvplan_memory *own) {
    for (int64_t i = 0; i < COUNT; i++) {
        memcpy(own->stages + i * STAGE, hdvplan_vehicle.stage, STAGE * sizeof(double));
        if (ROWS > 0)
            memcpy(own->rows + i * ROWS * ROW, hdvplan_vehicle.rows, ROWS * ROW * sizeof(double));
        own->ones[i] = 1.0;
    }
}

/* Put the terms in their order: the dynamics clear what others add to. */
static void put_terms(struct hdvplan_memory *own) {
    struct hdv_term *next = own->terms;
    *next++ = (struct hdv_term){hdv_linearise_dynamics, hdv_price_dynamics, &own->dynamics, NULL};
    *next++ = (struct hdv_term){hdv_linearise_steering, hdv_price_steering, &own->steering, NULL};
    *next++ = (struct hdv_term){hdv_linearise_centring, hdv_price_centring, &own->centring, NULL};
    if (ROWS > 0)
        *next++ = (struct hdv_term){hdv_linearise_limits, hdv_price_limits, &own->limits, &own->limits.violation};
    own->planner.term_count = next - own->terms;
}

/* Let everything lead to a road's tables. */
static void take_road(struct hdvplan_memory *own, const struct hdvplan_road *road) {
    own->planner.stations = road->stations;
    own->planner.states = road->states;
    own->planner.curvatures = road->curvatures;
    own->table_count = road->count;
    own->centring.curve = own->limits.curve = &road->curve;
    own->centring.residuals = road->residuals;
    own->steering.aim = road->angles;
    own->limits.street = &road->street;
}

int hdvplan_begin(struct hdvplan_memory *memory, const struct hdvplan_road *road) {
    struct hdvplan_memory *own = memory;
    if (!sizes_agree())
        return 0;
    memset(own, 0, sizeof *own);
    lay_out(own);
    lay_out_planner(own);
    fill(own);
    own->dynamics = hdvplan_vehicle.dynamics;
    own->centring = hdvplan_vehicle.centring;
    own->centring.weights = own->ones;
    own->centring.memory = own->centred;
    own->steering = hdvplan_vehicle.steering;
    own->steering.most = hdvplan_vehicle.most;
    own->steering.change = hdvplan_vehicle.change;
    own->limits = hdvplan_vehicle.limits;
    own->limits.behind = hdvplan_vehicle.behind;
    own->limits.seen = own->seen;
    own->limits.edges = own->edges;
    own->limits.near = &own->near;
    put_terms(own);
    take_road(own, road);
    return 1;
}

void hdvplan_refresh(struct hdvplan_memory *memory, const struct hdvplan_road *road, int64_t dropped) {
    struct hdv_planner *planner = &memory->planner;
    take_road(memory, road);
    planner->origin -= dropped;
    planner->reaches -= dropped;
    if (planner->last >= 0)
        planner->last -= dropped;
}

/* Whether a state lies where the road-aligned model holds, with room to plan. */
static int holds(const struct hdv_station *at, const double *z) {
    int finite = 1;
    for (int64_t j = 0; j < STATES; j++)
        finite &= isfinite(z[j]) != 0;
    return finite && 1.0 - z[0] * at->curvature > 0.0 && fabs(z[1]) < 1.5;
}

/* Drive the last plan's steering on from where the vehicle is, so that the motion keeps the dynamics; and look at what
 * it breaches. Returns 0 where it leaves the model. */
static int drive_on(struct hdvplan_memory *own) {
    const struct hdv_scene *scene = &own->scene;
    for (int64_t i = 0; i < STAGES; i++) {
        const struct hdv_station *at = scene->road + i;
        double *z = state_at(scene->motion, STATES, i), *next = state_at(scene->motion, STATES, i + 1), wheels[STATES];
        memcpy(wheels, next, sizeof wheels);
        hdv_advance(
            own->dynamics.rule, scene->units, UNITS, at->curvature, at->curvature_between, STEP_M, STATES, z, z[STATES],
            next
        );
        memcpy(next + STATES - WHEELS, wheels + STATES - WHEELS, WHEELS * sizeof(double));
        if (!holds(at + 1, next))
            return 0;
    }
    for (int64_t number = 0; number < own->planner.term_count; number++)
        if (own->terms[number].linearise(own->terms[number].data, scene, 1, 0) >= 0)
            return 0;
    own->planner.violation = own->limits.violation;
    own->planner.last = scene->first;
    return 1;
}

enum hdvplan_status
hdvplan_step(struct hdvplan_memory *memory, int64_t station, const double *state, double kappa_before) {
    struct hdv_planner *planner = &memory->planner;
    if (station < 0 || station + STAGES >= memory->table_count || !holds(planner->stations + station, state))
        return HDVPLAN_BEYOND;
    memcpy(memory->start, state, sizeof memory->start);
    int64_t stop = hdv_step(planner, station, kappa_before);
    if (stop == HDV_PLANNED && planner->usable && hdv_leaps(planner))
        return HDVPLAN_BEYOND;
    if (stop == HDV_PLANNED && planner->programs > 0)
        return planner->spent ? HDVPLAN_SPENT : planner->usable ? HDVPLAN_DONE : HDVPLAN_KEPT;
    if (stop == HDV_LOST || !drive_on(memory))
        return HDVPLAN_BEYOND;
    return planner->spent ? HDVPLAN_SPENT : HDVPLAN_KEPT;
}

const double *hdvplan_motion(const struct hdvplan_memory *memory, int64_t stage) {
    return memory->scene.motion + stage * (STATES + 1);
}

/* The road-aligned kinematics of a lead unit with any number of trailers, with exact derivatives. [GEO] eqs. 2 and 6.
 *
 * State z = (e_y, e_psi, beta_1, ..., delta_1, ...): lateral error of the lead unit's rear axle, heading error of its
 * body, then the articulation angle at every coupling (heading ahead minus heading behind), then the angle of the
 * wheels of every axle that the plan steers (left positive), whose rate is the plan's to choose and zero here. Input:
 * kappa = tan(front angle) / wheelbase [1/m].
 *
 * Every axle moves along its wheels, at an angle delta off its body: a state, or delta = -ratio * (front angle or
 * beta), held at
 * +-max_steering_angle. With velocities per metre that the lead body moves forward at its axle, a unit's axle moves
 * (forward, forward tan(delta)) in the body's axes, and the coupling behind it (forward, forward tan(delta) - hitch
 * turn). Turned by beta these are the velocities at the coupling of the next unit, whose wheels then decide how fast
 * that turns.
 */
#ifndef HDVPLAN_KINEMATICS_H
#define HDVPLAN_KINEMATICS_H

#include <math.h>

#include "angles.h"
#include "hdvplan.h"
#include "path.h"

/* Wheels of an axle: tan(delta), and its derivative by what steers them. */
struct wheels {
    double tan;
    double slope;
};

/* Motion of a unit at its axle, in the axes of its body, per metre that the lead body moves forward. */
struct rolling {
    double forward, sideways;
    double turn; /* [rad/m] */
};

/* Metres that the lead body moves forward per metre of road, with derivatives; its axle's velocity along and across. */
struct travel {
    double metres;
    double by_e_y, by_e_psi, by_kappa;
    double along, across;
};

struct plane_point {
    double x, y; /* [m] */
};

/* Wheels of a unit's axle that is steered by an angle [rad]; slope is by that angle. */
HDV_INLINE struct wheels wheels(const struct hdv_unit *unit, double angle) {
    if (unit->steering_ratio == 0.0)
        return (struct wheels){0.0, 0.0};
    if (fabs(unit->steering_ratio * angle) >= unit->max_steering_angle) {
        return (struct wheels){-copysign(tan(unit->max_steering_angle), angle), 0.0};
    }
    double turned = -tan(unit->steering_ratio * angle);
    return (struct wheels){turned, -unit->steering_ratio * (1.0 + turned * turned)};
}

/* Wheels of the lead rear axle; slope is by kappa. */
HDV_INLINE struct wheels rear_wheels(const struct hdv_unit *lead, double kappa) {
    if (lead->steering_ratio == 0.0)
        return (struct wheels){0.0, 0.0};
    double tan_front = lead->wheelbase * kappa;
    struct wheels rear = wheels(lead, atan(tan_front));
    rear.slope = rear.slope * lead->wheelbase / (1.0 + tan_front * tan_front);
    return rear;
}

/* Motion of the coupling behind a unit in the axes of the next one, turned by beta; linear: derivatives have it too. */
HDV_INLINE struct rolling at_coupling(struct rolling ahead, double hitch_offset, double cos_beta, double sin_beta) {
    double across = ahead.sideways - hitch_offset * ahead.turn;
    return (struct rolling){
        ahead.forward * cos_beta - across * sin_beta,
        ahead.forward * sin_beta + across * cos_beta,
        0.0,
    };
}

/* Motion of the lead unit. */
HDV_INLINE struct rolling lead_rolling(const struct hdv_unit *lead, double kappa, double tan_rear) {
    return (struct rolling){1.0, tan_rear, kappa - tan_rear / lead->wheelbase};
}

/* Motion of a unit with given wheels, from that of its coupling. */
HDV_INLINE struct rolling unit_rolling(const struct hdv_unit *unit, struct rolling coupling, double tan_wheels) {
    double sideways = coupling.forward * tan_wheels;
    return (struct rolling){coupling.forward, sideways, (coupling.sideways - sideways) / unit->wheelbase};
}

/* Writes dz/ds into f (n,), at the road's curvature k [1/m]. */
HDV_INLINE void
derivative(const struct hdv_unit *units, int64_t count, double k, int64_t n, const double *z, double kappa, double *f) {
    double rear = rear_wheels(units, kappa).tan;
    double cos_psi = cos(z[1]);
    double sin_psi = sin(z[1]);
    double travelled = (1.0 - z[0] * k) / (cos_psi - sin_psi * rear);
    struct rolling motion = lead_rolling(units, kappa, rear);
    f[0] = travelled * (sin_psi + cos_psi * rear);
    f[1] = travelled * motion.turn - k;
    for (int64_t i = 1; i < count; i++) {
        struct rolling coupling = at_coupling(motion, units[i - 1].hitch_offset, cos(z[1 + i]), sin(z[1 + i]));
        struct rolling behind = unit_rolling(units + i, coupling, wheels(units + i, z[units[i].steered_by]).tan);
        f[1 + i] = travelled * (motion.turn - behind.turn);
        motion = behind;
    }
    for (int64_t i = 1 + count; i < n; i++)
        f[i] = 0.0;
}

/* Metres that the lead body moves forward per metre of road, with derivatives; its axle's velocity along and across. */
HDV_INLINE struct travel lead_travel(double k, double e_y, const struct hdv_pose *pose, struct wheels rear) {
    double inside = 1.0 - e_y * k;
    double along = pose->turned_cos - pose->turned_sin * rear.tan;
    double across = pose->turned_sin + pose->turned_cos * rear.tan;
    return (struct travel){
        inside / along,
        -k / along,
        inside * across / (along * along),
        inside * pose->turned_sin / (along * along) * rear.slope,
        along,
        across,
    };
}

/* Writes the derivatives by z and kappa of the rate of one articulation angle, beta of unit i, into its row of a and
 * its entry of b.
 *
 * chain (n + 1,): derivatives by z and kappa of the motion of the unit ahead; those of unit i when done. turning is the
 * rate per metre that the lead body moves forward. */
HDV_INLINE void coupling_gradient(
    const struct hdv_unit *units, int64_t count, int64_t i, int64_t n, const struct hdv_pose *pose,
    struct rolling coupling, struct wheels axle, struct travel travel, double turning, struct rolling *chain,
    double *row, double *by_kappa
) {
    int64_t own = 1 + i;
    row[0] = travel.by_e_y * turning;
    row[1] = travel.by_e_psi * turning;
    for (int64_t column = 2; column <= n; column++) {
        if (own < column && column <= count) /* the couplings behind */
            continue;
        struct rolling ahead = chain[column];
        struct rolling change = at_coupling(ahead, units[i - 1].hitch_offset, pose->turned_cos, pose->turned_sin);
        if (column == own) {
            change.forward -= coupling.sideways;
            change.sideways += coupling.forward;
        }
        double by_wheels = column == units[i].steered_by ? coupling.forward * axle.slope : 0.0;
        struct rolling behind = {change.forward, change.forward * axle.tan + by_wheels, 0.0};
        behind.turn = (change.sideways - behind.sideways) / units[i].wheelbase;
        if (column < n)
            row[column] = travel.metres * (ahead.turn - behind.turn);
        else
            *by_kappa = travel.metres * (ahead.turn - behind.turn) + travel.by_kappa * turning;
        chain[column] = behind;
    }
}

/* Writes dz/ds into f (n,), its derivatives by z into a (n, n) and by kappa into b (n,).
 *
 * poses (count,) hold the sines and cosines of z, see turn: they cost as much as the rest. n <= HDV_MOST_STATES. */
HDV_INLINE void jacobian(
    const struct hdv_unit *units, int64_t count, double k, int64_t n, const double *z, double kappa,
    const struct hdv_pose *poses, double *f, double *a, double *b
) {
    struct rolling chain[HDV_MOST_STATES + 1];
    struct wheels rear = rear_wheels(units, kappa);
    struct travel travel = lead_travel(k, z[0], poses, rear);
    struct rolling motion = lead_rolling(units, kappa, rear.tan);
    double turn_by_kappa = 1.0 - rear.slope / units[0].wheelbase;
    for (int64_t j = 0; j < n * n; j++)
        a[j] = 0.0;
    f[0] = travel.metres * travel.across;
    a[0] = travel.by_e_y * travel.across;
    a[1] = travel.metres * travel.along + travel.by_e_psi * travel.across;
    b[0] = travel.metres / travel.along * rear.slope;
    f[1] = travel.metres * motion.turn - k;
    a[n] = travel.by_e_y * motion.turn;
    a[n + 1] = travel.by_e_psi * motion.turn;
    b[1] = travel.metres * turn_by_kappa + travel.by_kappa * motion.turn;
    for (int64_t column = 2; column < n; column++)
        chain[column] = (struct rolling){0.0, 0.0, 0.0};
    chain[n] = (struct rolling){0.0, rear.slope, turn_by_kappa};
    for (int64_t i = 1; i < count; i++) {
        const struct hdv_pose *pose = poses + i;
        struct wheels axle = wheels(units + i, z[units[i].steered_by]);
        struct rolling coupling = at_coupling(motion, units[i - 1].hitch_offset, pose->turned_cos, pose->turned_sin);
        struct rolling behind = unit_rolling(units + i, coupling, axle.tan);
        double turning = motion.turn - behind.turn;
        f[1 + i] = travel.metres * turning;
        coupling_gradient(units, count, i, n, pose, coupling, axle, travel, turning, chain, a + (1 + i) * n, b + 1 + i);
        motion = behind;
    }
    for (int64_t i = 1 + count; i < n; i++) {
        f[i] = 0.0;
        b[i] = 0.0;
    }
}

/* Writes the sine and cosine of e_psi, and of every articulation angle, into poses (count,). */
HDV_INLINE void turn(int64_t count, const double *z, struct hdv_pose *poses) {
    for (int64_t i = 0; i < count; i++)
        cosine_and_sine(z[1 + i], &poses[i].turned_cos, &poses[i].turned_sin);
}

/* Writes every unit's pose into poses (count,). Place and heading are the road's where the lead rear axle is. */
HDV_INLINE void place(
    const struct hdv_unit *units, int64_t count, double x, double y, double heading_cos, double heading_sin,
    const double *z, struct hdv_pose *poses
) {
    turn(count, z, poses);
    struct hdv_pose at = poses[0];
    at.cos = heading_cos * at.turned_cos - heading_sin * at.turned_sin;
    at.sin = heading_sin * at.turned_cos + heading_cos * at.turned_sin;
    at.x = x - z[0] * heading_sin;
    at.y = y + z[0] * heading_cos;
    at.coupling_x = at.x;
    at.coupling_y = at.y;
    poses[0] = at;
    for (int64_t i = 1; i < count; i++) {
        struct hdv_pose ahead = poses[i - 1];
        at = poses[i];
        at.coupling_x = ahead.x - units[i - 1].hitch_offset * ahead.cos;
        at.coupling_y = ahead.y - units[i - 1].hitch_offset * ahead.sin;
        at.cos = ahead.cos * at.turned_cos + ahead.sin * at.turned_sin;
        at.sin = ahead.sin * at.turned_cos - ahead.cos * at.turned_sin;
        at.x = at.coupling_x - units[i].wheelbase * at.cos;
        at.y = at.coupling_y - units[i].wheelbase * at.sin;
        poses[i] = at;
    }
}

/* The point of a body that lies ahead of its axle and left of its axis [m]. */
HDV_INLINE struct plane_point body_point(const struct hdv_pose *pose, double ahead, double left) {
    return (struct plane_point){
        pose->x + ahead * pose->cos - left * pose->sin,
        pose->y + ahead * pose->sin + left * pose->cos,
    };
}

/* Writes the derivative by z of the motion of a unit's body point in direction (along_x, along_y) into gradient (n,).
 *
 * road is the station where the lead rear axle is: e_y moves every point along its normal. n may be more than the
 * states of z: all but the entries of e_y, e_psi and the couplings ahead of the point are zero. */
HDV_INLINE void point_gradient(
    const struct hdv_pose *poses, int64_t unit, struct plane_point point, const struct hdv_station *road,
    double along_x, double along_y, int64_t n, double *gradient
) {
    gradient[0] = -road->sin * along_x + road->cos * along_y;
    gradient[1] = -(point.y - poses[0].y) * along_x + (point.x - poses[0].x) * along_y;
    for (int64_t i = 1; i <= unit; i++)
        gradient[1 + i] = (point.y - poses[i].coupling_y) * along_x - (point.x - poses[i].coupling_x) * along_y;
    for (int64_t i = 2 + unit; i < n; i++)
        gradient[i] = 0.0;
}

#endif

/* The street in the plane: the kerbs that bound it, and how near a body is to them. */
#ifndef HDVPLAN_STREET_H
#define HDVPLAN_STREET_H

#include "hdvplan.h"

enum { HDV_SECTIONS = 2 }; /* of a body's length, rear to front: each has its own tightest contact to either side */

/* A straight piece of a kerb. Along its direction the street lies on its left. */
struct hdv_piece {
    double x, y;                   /* where it begins [m] */
    double cos, sin;               /* its direction */
    double length;                 /* [m], none of a kerb's last point */
    double before_cos, before_sin; /* direction of the piece that ends where it begins; its own where none does */
    double from_cos, from_sin;     /* direction of the kerb's run to where it begins, none where the kerb does */
    double to_cos, to_sin;         /* the same on from there */
    double s_low, s_high;          /* the stretch of line that it belongs to [m] */
    double s_begin, s_end;         /* the line's arclength beside its beginning and its end [m] */
    int64_t kerb;                  /* its number: of each kerb the nearest place counts, of several the tightest */
    int64_t left;                  /* 1: the street's left kerb, 0: its right one */
    int64_t wheels;                /* 1: bounds wheels and what lies between axles, 0: bounds all of a body */
    int64_t corner;                /* 1: its beginning protrudes into the street */
    int64_t wall;                  /* 1: it stands across the street */
    int64_t ends;                  /* 1: the kerb ends where it begins: beyond that the street is open */
    int64_t ends_after;            /* 1: and where it ends */
};

enum { HDV_TOGETHER = 16 }; /* pieces of a block */

/* Some neighbouring pieces of one kerb, in the order of their numbers: what is asked of many of them is computed side
 * by side, and without a branch. Places that are left repeat the last piece. */
struct hdv_block {
    double s_low, s_high; /* the stretch of line to which they belong [m] */
    int64_t kerb, left, wheels;
    int64_t corners; /* a bit for every place, the lowest for the first: 1 where the piece has a corner */
    int64_t count;
    double x[HDV_TOGETHER], y[HDV_TOGETHER];     /* as the pieces have them [m] */
    double cos[HDV_TOGETHER], sin[HDV_TOGETHER]; /* of their directions */
    double length[HDV_TOGETHER];                 /* [m] */
    int64_t numbers[HDV_TOGETHER];
};

/* All pieces, in the order of s_low. */
struct hdv_street {
    const struct hdv_piece *pieces;
    const double *reach; /* (count,), the largest s_high up to each piece [m] */
    int64_t count;
    const struct hdv_block *blocks; /* in the order of s_low */
    const double *block_reach;      /* (block_count,), the largest s_high up to each block [m] */
    int64_t block_count;
    double end;       /* of the road: once the lead axle has left it, what lies beyond is not kept [m] */
    double clearance; /* that a plan keeps from walls across the street, too [m] */
};

/* Where a body is nearest to a kerb, or furthest beyond it. */
struct hdv_contact {
    double gap;              /* signed distance, negative beyond the kerb; infinite where there is none [m] */
    double ahead, left;      /* the body's point that meets the kerb: ahead of its axle, left of its axis [m] */
    double along_x, along_y; /* the gap grows as this point moves in this direction, a unit vector in the plane */
    double s;                /* of the kerb there [m] */
    int64_t piece;
};

/* What is tightest of a body: to the left and to the right kerbs, in each section of its length. */
struct hdv_contacts {
    struct hdv_contact at[2][HDV_SECTIONS];
    double near[2];                    /* the least gap to either side's kerbs, walls across the street included [m] */
    struct hdv_contact overhang[2][2]; /* of its rear and its front corner with the kerbs that wheels must keep */
};

/* The tightest contact of a body's section with one side's kerbs, while the vehicle moves from a pose to the next. */
struct hdv_touch {
    double gap;    /* negative beyond the kerb; infinite where there is none [m] */
    double s;      /* of the kerb there [m] */
    double x, y;   /* of the body's point [m] */
    double ahead;  /* of the body's axle, of that point [m] */
    int64_t piece; /* of the kerb, -1: none */
};

/* How contacts are looked for. */
enum hdv_look {
    HDV_TO_PLAN, /* by the side that a kerb has: a body beyond it is led back; walls across lead nowhere */
    HDV_TO_JUDGE /* what is inside and outside alone counts */
};

enum { HDV_SOME = 128 };

/* Some pieces of a street near a body, by blocks. */
struct hdv_near {
    int64_t count; /* -1: too many pieces to be listed */
    double reach;  /* further from the body there are others [m] */
    struct hdv_block blocks[HDV_SOME];
};

/* Arclengths of the line [m]. */
struct stretch_of_line {
    double low, high;
};

/* A rectangle in the axes of a body, and the stretch of line that it is beside. */
struct box_beside {
    const struct hdv_pose *pose;
    double rear, front, side; /* [m], ``side`` to the left and to the right */
    struct stretch_of_line line;
};

struct box_beside
box_around(const struct hdv_unit *unit, const struct hdv_pose *pose, double s, double behind, double reach);
int64_t next_in(const struct hdv_street *street, const struct box_beside *in, int64_t from);
void pieces_near(
    const struct hdv_street *street, const struct hdv_unit *unit, const struct hdv_pose *pose, double s, double behind,
    double reach, struct hdv_near *found
);
void look_at_body(
    const struct hdv_street *street, const struct hdv_near *among, enum hdv_look look, const struct hdv_unit *unit,
    const struct hdv_pose *pose, double s, double behind, struct hdv_contacts *found
);

#endif

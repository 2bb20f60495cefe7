/* What hdvplan/core.py asks a library: fields of all records, of which it makes its own; the constants that Python
 * shares; and what the library was built from. hatch_build.py writes the table from the headers. */
#include "layout.h"

struct hdv_layout {
    const char *record, *field; /* the whole record has no field, a constant no record */
    const char *kind;           /* f: a double, i: an integer, p: anything else, c: a constant */
    int64_t offset, size;       /* [bytes] */
    double value;               /* of a constant */
};

/* The last row has no names. */
HDV_EXPORT const struct hdv_layout *hdv_layout(void) {
    static const struct hdv_layout rows[] = {HDV_LAYOUT{NULL, NULL, NULL, 0, 0, 0.0}};
    return rows;
}

HDV_EXPORT const char *hdv_sources(void) {
    return HDV_SOURCES;
}

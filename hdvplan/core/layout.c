/* What hdvplan/core.py asks a library: fields of all records, of which it makes its own; the constants that Python
 * shares; and what the library was built from. hatch_build.py writes both tables from the headers. */
#include "layout.h"

struct hdv_layout {
    const char *record, *field; /* the whole record has no field */
    const char *kind;           /* f: a double, i: an integer, p: anything else */
    int64_t offset, size;       /* [bytes] */
};

struct hdv_constant {
    const char *name;
    double value;
};

/* Both tables end with a row without a name. */
HDV_EXPORT const struct hdv_layout *hdv_layout(void) {
    static const struct hdv_layout rows[] = {HDV_LAYOUT{NULL, NULL, NULL, 0, 0}};
    return rows;
}

HDV_EXPORT const struct hdv_constant *hdv_constants(void) {
    static const struct hdv_constant rows[] = {HDV_CONSTANTS{NULL, 0.0}};
    return rows;
}

HDV_EXPORT const char *hdv_sources(void) {
    return HDV_SOURCES;
}

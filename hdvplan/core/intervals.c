#include "prove.h"

#include <string.h>

/* Add [low, high] to pieces and return how many there are, at most so many: of too many, the closest are joined. */
int64_t join_interval(struct interval *pieces, int64_t total, int64_t most, double low, double high) {
    int64_t first = 0;
    if (low > high)
        return total;
    while (first < total && pieces[first].high < low)
        first++;
    int64_t last = first;
    while (last < total && pieces[last].low <= high) { /* first <= p < last become one with the new one */
        low = smaller(low, pieces[last].low);
        high = larger(high, pieces[last].high);
        last++;
    }
    if (last == first && total == most) { /* the nearer neighbour grows */
        if (first > 0 && (first == total || low - pieces[first - 1].high <= pieces[first].low - high))
            pieces[first - 1].high = high;
        else
            pieces[first].low = low;
        return total;
    }
    memmove(&pieces[first + 1], &pieces[last], (size_t)(total - last) * sizeof *pieces);
    pieces[first] = (struct interval){low, high};
    return total - (last - first) + 1;
}

/* Copy intervals to where there is room for fewer, the last of which are joined; return how many there are. */
int64_t keep_intervals(struct interval *found, int64_t number, struct interval *pieces, int64_t most) {
    while (number > most) {
        found[number - 2].high = found[number - 1].high;
        number--;
    }
    memcpy(pieces, found, (size_t)number * sizeof *pieces);
    return number;
}

#!/bin/sh
# development build of the C core, until pip builds it
cd "$(dirname "$0")" && cc -std=c99 -Wall -Wextra -Werror -pedantic -O3 -march=x86-64-v3 -ffp-contract=fast -fno-math-errno -fno-trapping-math -fvisibility=hidden -fPIC -shared -o hdvplan/_core.so hdvplan/core/*.c -lm

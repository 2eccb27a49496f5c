// Count the floating-point operations of an exported step, compiled as C++ with numbers that count, for
// tests/test_embedded.py. Prints status, steps, inner and operations for each line of numbers that it reads.
#include <math.h>
#include <stdio.h>

static long operations;

struct counted {
    double value;
    counted() = default;
    constexpr counted(double x) : value(x) {}
    explicit operator double() const { return value; }
};

#define ARITHMETIC(sign)                                    \
    static counted operator sign(counted a, counted b) {    \
        operations++;                                       \
        return counted(a.value sign b.value);               \
    }                                                       \
    [[maybe_unused]] static counted &operator sign##=(counted &a, counted b) { return a = a sign b; }
ARITHMETIC(+)
ARITHMETIC(-)
ARITHMETIC(*)
ARITHMETIC(/)
#define COMPARISON(sign) \
    [[maybe_unused]] static bool operator sign(counted a, counted b) { return a.value sign b.value; }
COMPARISON(<)
COMPARISON(>)
COMPARISON(<=)
COMPARISON(>=)
COMPARISON(==)
COMPARISON(!=)
static counted operator-(counted a) { return counted(-a.value); }
static counted sqrt(counted a) {
    operations++;
    return counted(sqrt(a.value));
}
static counted sin(counted a) { return counted(sin(a.value)); }
static counted cos(counted a) { return counted(cos(a.value)); }
[[maybe_unused]] static counted fabs(counted a) { return counted(fabs(a.value)); }

typedef counted towline_real;
#define restrict
#include "towline_step.c"

int main() {
    double number;
    for (;;) {
        towline_input input = {};
        towline_real *const parts[] = {
            input.pose,         input.velocity, input.acceleration,
#if TOWLINE_CARRIERS > 0
            input.carrier_pose,
#endif
#if TOWLINE_WIND
            input.wind,
#endif
            input.disturbance,
        };
        const int sizes[] = {
            6, 6, 6,
#if TOWLINE_CARRIERS > 0
            6 * TOWLINE_CARRIERS,
#endif
#if TOWLINE_WIND
            3,
#endif
            6,
        };
        for (unsigned part = 0; part < sizeof sizes / sizeof *sizes; part++) {
            for (int i = 0; i < sizes[part]; i++) {
                if (scanf("%lf", &number) != 1) {
                    return 0;
                }
                parts[part][i] = number;
            }
        }
        towline_state state;
        towline_answer answer;
        towline_start(&state);
        operations = 0;
        towline_step(&input, &state, &answer);
        printf("%d %d %d %ld\n", (int)answer.status, answer.steps, answer.inner, operations);
    }
}

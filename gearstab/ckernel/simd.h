/* Vectors of LANES doubles and the elementary functions the kernel needs on them.

   Included by level_*.c, each of which has chosen LANES and a target; a vector holds one number of LANES mesh
   frequencies. GCC's and Clang's vector extensions, no vector library, no relaxed arithmetic; a level may define LARGER and
   ANY by the instructions that compilers do not find by themselves.
   The polynomials are interpolations at Chebyshev nodes, whose errors stand beside them; a*b + c becomes
   a fused multiply-add where the target has one. */

#ifndef GEARSTAB_SIMD_H
#define GEARSTAB_SIMD_H

#include <math.h>
#include <stdint.h>
#include <string.h>

typedef double vec __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));   /* lanes of 0 or -1: what a comparison gives */
typedef uint64_t bits __attribute__((vector_size(8 * LANES)));
typedef int8_t bytes __attribute__((vector_size(LANES)));

#define INLINE static inline __attribute__((always_inline, unused))

#define NOT_INLINED __attribute__((noinline))

/* For loops whose number of turns is a small constant where they are inlined. */
#define UNROLLED _Pragma("GCC unroll 8")

#define SIGN_BIT (UINT64_C(1) << 63)

INLINE vec all(double value) { return value - (vec){0}; }

INLINE vec load(const double *from) {
    vec value;
    memcpy(&value, from, sizeof value);
    return value;
}

INLINE void store(double *to, vec value) { memcpy(to, &value, sizeof value); }

INLINE vec choose(mask m, vec a, vec b) { return (vec)((m & (mask)a) | (~m & (mask)b)); }

INLINE vec magnitude(vec a) { return (vec)((bits)a & ~SIGN_BIT); }

INLINE vec with_sign_of(vec size, vec sign) { return (vec)(((bits)size & ~SIGN_BIT) | ((bits)sign & SIGN_BIT)); }

/* b where one of the two is NaN. */
INLINE vec larger(vec a, vec b) {
#ifdef LARGER
    return LARGER(a, b);
#else
    return choose(a > b, a, b);
#endif
}

INLINE vec smaller(vec a, vec b) { return -larger(-a, -b); }

INLINE int any(mask m) {
#ifdef ANY
    return ANY(m);
#else
    int64_t found = 0;
    UNROLLED for (int i = 0; i < LANES; i++)
        found |= m[i];
    return found != 0;
#endif
}

/* The integer e of |a| = 2^e f, 1 <= f < 2; -1023 (or -infinity) for 0. */
INLINE vec exponent_of(vec a) {
#ifdef EXPONENT
    return EXPONENT(a);
#else
    return (vec)(((bits)magnitude(a) >> 52) | UINT64_C(0x4330000000000000)) - (0x1p52 + 1023);
#endif
}

INLINE vec root(vec a) {
    UNROLLED for (int i = 0; i < LANES; i++)
        a[i] = sqrt(a[i]);
    return a;
}

/* cos and sin of 2 pi a b: the phase is counted in turns, so that its reduction is exact (with a fused multiply-add even
   that of the product). Right to 1e-16 for |a b| < 2^49. */
INLINE void cosine_sine(vec a, vec b, vec *cosine, vec *sine) {
    const double quarters = 0x1.8p50; /* a sum with it is rounded to quarter turns, counted in its last bits */
    vec shifted = a * b + quarters;
    vec r = a * b - (shifted - quarters);
    bits quadrant = (bits)shifted;
    vec z = r * r;
    vec s = 3.7863799255659596 * z - 15.094052302270763; /* error 9e-18 for |r| <= 1/8 */
    s = s * z + 42.05868915802012;
    s = s * z - 76.7058597355092;
    s = s * z + 81.60524927605151;
    s = s * z - 41.341702240399755;
    s = s * z + 2.4492935982947064e-16; /* 2 pi is the double below plus this */
    s = r * 6.283185307179586 + r * s;
    vec c = -1.6990099194691812 * z + 7.903205859036896; /* error 2e-17 */
    c = c * z - 26.426253259020736;
    c = c * z + 60.24464135257915;
    c = c * z - 85.45681720664341;
    c = c * z + 64.93939402266824;
    c = c * z - 19.739208802178716;
    c = c * z + 1.0;
    mask odd = (mask)((quadrant & 1) != 0);
    *sine = (vec)((bits)choose(odd, c, s) ^ ((quadrant << 62) & SIGN_BIT));
    *cosine = (vec)((bits)choose(odd, s, c) ^ (((quadrant + 1) << 62) & SIGN_BIT));
}

/* e^x - 1 for |x| <= ln(2)/2. */
INLINE vec small_expm1(vec x) {
    vec z = x * x; /* even and odd powers side by side, error 1e-17 */
    vec even = 2.7620201591031547e-07 * z + 2.4801521057868204e-05;
    vec odd = 2.5100472505694996e-08 * z + 2.7557268276905696e-06;
    even = even * z + 0.0013888888917367081;
    odd = odd * z + 0.00019841269863171557;
    even = even * z + 0.041666666666623824;
    odd = odd * z + 0.008333333333330039;
    even = even * z + 0.5000000000000001;
    odd = odd * z + 0.16666666666666669;
    return z * (odd * x + even) + x;
}

/* e^x for |x| < 700; 0 below. */
INLINE vec exponential(vec x) {
    const double integers = 0x1.8p52;
    vec clipped = larger(smaller(x, all(700.0)), all(-700.0));
    vec shifted = clipped * 1.4426950408889634 + integers;
    vec k = shifted - integers;
    vec p = small_expm1((clipped - k * 0.6931471804855391) - k * 7.440617110012397e-11); /* the first product is exact */
    vec power = (vec)(((bits)shifted + 1023) << 52);
    return choose(x < -700.0, all(0.0), p * power + power);
}

/* sinh(x) for 0 <= x <= 1, to the last digit however small x is. */
INLINE vec small_sinh(vec x) {
    vec z = x * x;
    vec p = 7.746278224810715e-13 * z + 1.6057676882739475e-10; /* error 1e-17 */
    p = p * z + 2.50521177239532e-08;
    p = p * z + 2.7557319191250885e-06;
    p = p * z + 0.00019841269841324471;
    p = p * z + 0.008333333333333299;
    p = p * z + 0.16666666666666666;
    return (x * z) * p + x;
}

/* ln x for normal x > 0. */
INLINE vec logarithm(vec x) {
    bits offset = (bits)x - UINT64_C(0x3fe6a09e667f3bcd); /* of sqrt(1/2): mantissas m on both sides of 1 */
    bits exponent = ((offset >> 52) ^ 0x800) & 0xfff;     /* plus 2048, positive */
    vec m = (vec)((bits)x - (offset & (UINT64_C(0xfff) << 52)));
    vec k = (vec)(exponent | UINT64_C(0x4330000000000000)) - 0x1.00000000008p52;
    vec s = (m - 1.0) / (m + 1.0);
    vec z = s * s;
    vec p = 0.14617807153417325 * z + 0.15331611722055008; /* error 9e-18 */
    p = p * z + 0.1818289243253687;
    p = p * z + 0.22222211089379496;
    p = p * z + 0.28571428626253836;
    p = p * z + 0.3999999999989889;
    p = p * z + 0.666666666666667;
    /* 2 s + s z p written around m - 1, which is exact. */
    vec rest = s * ((m - 1.0) - z * p);
    return k * 0.6931471804855391 + ((m - 1.0) - (rest - k * 7.440617110012397e-11));
}

/* ln(1 + x) for x >= 0. */
INLINE vec logarithm1p(vec x) {
    vec one_more = 1.0 + x;
    return logarithm(one_more) + (x - (one_more - 1.0)) / one_more;
}

/* Vectors of the right alignment; release with free. */
INLINE vec *vectors(int64_t count, void **memory) {
    *memory = malloc(((size_t)count + 1) * sizeof(vec));
    if (!*memory)
        return NULL;
    return (vec *)(((uintptr_t)*memory + sizeof(vec) - 1) & ~(uintptr_t)(sizeof(vec) - 1));
}

#endif

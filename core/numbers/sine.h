/*
 * Sine and cosine of angles up to some 1e6 rad, below one unit in the last place.
 *
 * The polynomials are those of Sun's fdlibm. There are no branches, and so the bits are the same in lanes as for one
 * number, by every compiler that neither contracts nor reorders, on every system and in a web page.
 */
INLINE void sine_and_cosine(num x, num *sine, num *cosine) {
    const double shift = 6755399441055744.0; /* 1.5 * 2^52: added, it rounds to whole numbers */
    const num shifted = x * 0.63661977236758134308 + shift, quarters = shifted - shift;
    /* pi / 2 in three parts, of which the first two have zeros at their end. */
    const num r = ((x - quarters * 1.57079632673412561417e+00) - quarters * 6.07710050630396597660e-11) -
                  quarters * 2.02226624879595063154e-21;
    const num z = r * r, half = 0.5 * z, rest = 1.0 - half;
    const num s = r + r * z *
                          (z * (z * (z * (z * (z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08) +
                                          2.75573137070700676789e-06) -
                                     1.98412698298579493134e-04) +
                                8.33333333332248946124e-03) -
                           1.66666666666666324348e-01);
    const num c = rest + (((1.0 - rest) - half) +
                          z * z *
                              (z * (z * (z * (z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11) -
                                              2.75573143513906633035e-07) +
                                         2.48015872894767294178e-05) -
                                    1.38888888888741095749e-03) +
                               4.16666666666666019037e-02));
    /* In odd quarters the two change places; the second and third, or first and second, have the other sign. */
    const bits quarter = bits_of(shifted), odd = -(quarter & 1);
    const bits a = (bits_of(s) & ~odd) | (bits_of(c) & odd), b = (bits_of(c) & ~odd) | (bits_of(s) & odd);
    *sine = from_bits(a ^ ((quarter & 2) << 62));
    *cosine = from_bits(b ^ (((quarter + 1) & 2) << 62));
}

/*
 * The angle of the vector (x, y) from the x axis, from -pi to pi, within two units in the last place.
 *
 * The polynomial is that of Sun's fdlibm for tangents up to 7 / 16. There are no branches, see sine.h. A y of -0 is that
 * of +0; the angle of (0, 0) is 0.
 */
INLINE num angle_of(num y, num x) {
    const double shallow = 0.41421356237309504880; /* tan(pi / 8) */
    const mask upright = magnitude(y) > magnitude(x);
    const num across = where(upright, magnitude(x), magnitude(y)), along = where(upright, magnitude(y), magnitude(x));
    /* From the nearest of eight directions. */
    const mask steep = across > shallow * along;
    const num below = where(steep, across + along, along);
    const num u = where(steep, across - along, across) / where(below == 0, number(1), below), z = u * u;
    const num series =
        z * (z * (z * (z * (z * (z * (z * (z * (z * (z * 1.62858201153657823623e-02 - 3.65315727442169155270e-02) +
                                                4.97687799461593236017e-02) -
                                           5.83357013379057348645e-02) +
                                      6.66107313738753120669e-02) -
                                 7.69187620504482999495e-02) +
                            9.09088713343650656196e-02) -
                       1.11111104054623557880e-01) +
                  1.42857142725034663711e-01) -
             1.99999999998764832476e-01) +
        3.33333333333329318027e-01;
    const num first = where(steep, number(0.78539816339744830962), number(0)) + (u - u * (z * series));
    const num quarter = where(upright, 1.57079632679489661923 - first, first);
    const num half = where(x < 0, 3.14159265358979323846 - quarter, quarter);
    return where(y < 0, -half, half);
}

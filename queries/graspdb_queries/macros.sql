-- Functions for queries. Each has a comment above it: what it gives, then an example that runs as it stands.
-- Vectors are lists of 3, quaternions unit quaternions w x y z, transforms 4 x 4 matrices row by row.
-- [... for x in [{...}]][1] names what an expression uses often, so that it is worked out once.

-- Length of a vector.
-- norm([3, 4, 12])
CREATE MACRO norm(v) AS
    sqrt(v[1]::DOUBLE ** 2 + v[2]::DOUBLE ** 2 + v[3]::DOUBLE ** 2);

-- Distance between two points.
-- 1000 * distance([0, 0, 0], [0.03, 0.04, 0])
CREATE MACRO distance(a, b) AS
    sqrt((a[1]::DOUBLE - b[1]) ** 2 + (a[2]::DOUBLE - b[2]) ** 2 + (a[3]::DOUBLE - b[3]) ** 2);

-- Scalar product of two vectors.
-- dot_product([1, 2, 3], [4, 5, 6])
CREATE MACRO dot_product(a, b) AS
    a[1]::DOUBLE * b[1] + a[2]::DOUBLE * b[2] + a[3]::DOUBLE * b[3];

-- Vector product of two vectors.
-- cross_product([1, 0, 0], [0, 1, 0])
CREATE MACRO cross_product(a, b) AS
    CASE WHEN list_count(a) = 3 AND list_count(b) = 3 THEN
    [
        [x.a[2] * x.b[3] - x.a[3] * x.b[2], x.a[3] * x.b[1] - x.a[1] * x.b[3], x.a[1] * x.b[2] - x.a[2] * x.b[1]]
        for x in [{a: a::DOUBLE[], b: b::DOUBLE[]}]
    ][1] END;

-- Angle between two vectors, 0 to pi [rad]; null where one has no length.
-- to_deg(angle_between([1, 0, 0], [0, 2, 0]))
CREATE MACRO angle_between(a, b) AS
    CASE WHEN norm(a) > 0 AND norm(b) > 0 THEN atan2(norm(cross_product(a, b)), dot_product(a, b)) END;

-- Vector v turned by the rotation of quaternion q.
-- quaternion_rotate([0, 0, 0, 1], [1, 0, 0])
CREATE MACRO quaternion_rotate(q, v) AS
    CASE WHEN list_count(q) = 4 AND list_count(v) = 3 THEN
    [
        [
            x.v[1] + 2 * (x.q[1] * x.t[1] + x.q[3] * x.t[3] - x.q[4] * x.t[2]),
            x.v[2] + 2 * (x.q[1] * x.t[2] + x.q[4] * x.t[1] - x.q[2] * x.t[3]),
            x.v[3] + 2 * (x.q[1] * x.t[3] + x.q[2] * x.t[2] - x.q[3] * x.t[1])
        ]
        for x in [{q: q::DOUBLE[], v: v::DOUBLE[], t: cross_product(q[2:4], v)}]
    ][1] END;

-- Quaternion of the rotation that does b first, then a.
-- quaternion_multiply([0, 1, 0, 0], [0, 0, 1, 0])
CREATE MACRO quaternion_multiply(a, b) AS
    CASE WHEN list_count(a) = 4 AND list_count(b) = 4 THEN
    [
        [
            x.a[1] * x.b[1] - x.a[2] * x.b[2] - x.a[3] * x.b[3] - x.a[4] * x.b[4],
            x.a[1] * x.b[2] + x.a[2] * x.b[1] + x.a[3] * x.b[4] - x.a[4] * x.b[3],
            x.a[1] * x.b[3] - x.a[2] * x.b[4] + x.a[3] * x.b[1] + x.a[4] * x.b[2],
            x.a[1] * x.b[4] + x.a[2] * x.b[3] - x.a[3] * x.b[2] + x.a[4] * x.b[1]
        ]
        for x in [{a: a::DOUBLE[], b: b::DOUBLE[]}]
    ][1] END;

-- Quaternion of the opposite rotation.
-- quaternion_inverse([0.8, 0.6, 0, 0])
CREATE MACRO quaternion_inverse(q) AS
    CASE WHEN list_count(q) = 4 THEN [[x[1], -x[2], -x[3], -x[4]] for x in [q::DOUBLE[]]][1] END;

-- Angle of the rotation that leads from orientation a to orientation b, 0 to pi [rad].
-- to_deg(quaternion_angle([1, 0, 0, 0], [0.6, 0.8, 0, 0]))
CREATE MACRO quaternion_angle(a, b) AS
    [
        2 * atan2(norm(x[2:4]), abs(x[1]))
        for x in [quaternion_multiply(quaternion_inverse(a), b)]
    ][1];

-- Transform that turns by quaternion q, then moves by position p.
-- transform_from([0.1, 0, 0], [0, 0, 0, 1])
CREATE MACRO transform_from(p, q) AS
    CASE WHEN list_count(p) = 3 AND list_count(q) = 4 THEN
    [
        [
            [1 - 2 * (x.y * x.y + x.z * x.z), 2 * (x.x * x.y - x.w * x.z), 2 * (x.x * x.z + x.w * x.y), x.p[1]],
            [2 * (x.x * x.y + x.w * x.z), 1 - 2 * (x.x * x.x + x.z * x.z), 2 * (x.y * x.z - x.w * x.x), x.p[2]],
            [2 * (x.x * x.z - x.w * x.y), 2 * (x.y * x.z + x.w * x.x), 1 - 2 * (x.x * x.x + x.y * x.y), x.p[3]],
            [0.0, 0.0, 0.0, 1.0]
        ]
        for x in [{p: p::DOUBLE[], w: q[1]::DOUBLE, x: q[2]::DOUBLE, y: q[3]::DOUBLE, z: q[4]::DOUBLE}]
    ][1] END;

-- Point p taken by transform t.
-- transform_point(transform_from([0.1, 0, 0], [0, 0, 0, 1]), [1, 2, 3])
CREATE MACRO transform_point(t, p) AS
    CASE WHEN list_count(flatten(t)) = 16 AND list_count(p) = 3 THEN
    [
        [
            x.t[1][1] * x.p[1] + x.t[1][2] * x.p[2] + x.t[1][3] * x.p[3] + x.t[1][4],
            x.t[2][1] * x.p[1] + x.t[2][2] * x.p[2] + x.t[2][3] * x.p[3] + x.t[2][4],
            x.t[3][1] * x.p[1] + x.t[3][2] * x.p[2] + x.t[3][3] * x.p[3] + x.t[3][4]
        ]
        for x in [{t: t::DOUBLE[][], p: p::DOUBLE[]}]
    ][1] END;

-- Vector v turned by transform t, not moved: for normals and other directions.
-- transform_vector(transform_from([0.1, 0, 0], [0, 0, 0, 1]), [1, 2, 3])
CREATE MACRO transform_vector(t, v) AS
    CASE WHEN list_count(flatten(t)) = 16 AND list_count(v) = 3 THEN
    [
        [
            x.t[1][1] * x.v[1] + x.t[1][2] * x.v[2] + x.t[1][3] * x.v[3],
            x.t[2][1] * x.v[1] + x.t[2][2] * x.v[2] + x.t[2][3] * x.v[3],
            x.t[3][1] * x.v[1] + x.t[3][2] * x.v[2] + x.t[3][3] * x.v[3]
        ]
        for x in [{t: t::DOUBLE[][], v: v::DOUBLE[]}]
    ][1] END;

-- Inverse of a rigid transform: b_from_a of a_from_b.
-- transform_inverse(transform_from([0.1, 0, 0], [0, 0, 0, 1]))
CREATE MACRO transform_inverse(t) AS
    CASE WHEN list_count(flatten(t)) = 16 THEN
    [
        [
            [x[1][1], x[2][1], x[3][1], -(x[1][1] * x[1][4] + x[2][1] * x[2][4] + x[3][1] * x[3][4])],
            [x[1][2], x[2][2], x[3][2], -(x[1][2] * x[1][4] + x[2][2] * x[2][4] + x[3][2] * x[3][4])],
            [x[1][3], x[2][3], x[3][3], -(x[1][3] * x[1][4] + x[2][3] * x[2][4] + x[3][3] * x[3][4])],
            [0.0, 0.0, 0.0, 1.0]
        ]
        for x in [t::DOUBLE[][]]
    ][1] END;

-- Transform that does b first, then a: c_from_a of c_from_b and b_from_a.
-- transform_compose(transform_from([1, 0, 0], [0, 0, 0, 1]), transform_from([1, 0, 0], [1, 0, 0, 0]))
CREATE MACRO transform_compose(a, b) AS
    CASE WHEN list_count(flatten(a)) = 16 AND list_count(flatten(b)) = 16 THEN
    [
        [
            [r[1] * x.b[1][j] + r[2] * x.b[2][j] + r[3] * x.b[3][j] + r[4] * x.b[4][j] for j in [1, 2, 3, 4]]
            for r in x.a
        ]
        for x in [{a: a::DOUBLE[][], b: b::DOUBLE[][]}]
    ][1] END;

-- Where transform t puts the origin: a point.
-- transform_position(transform_from([0.1, 0, 0], [0, 0, 0, 1]))
CREATE MACRO transform_position(t) AS
    CASE WHEN list_count(flatten(t)) = 16 THEN [t[1][4]::DOUBLE, t[2][4]::DOUBLE, t[3][4]::DOUBLE] END;

-- Angle of the rotation that leads from the orientation of transform a to that of b, 0 to pi [rad].
-- to_deg(transform_angle(transform_from([0, 0, 0], [1, 0, 0, 0]), transform_from([0, 0, 0], [0.6, 0.8, 0, 0])))
CREATE MACRO transform_angle(a, b) AS
    CASE WHEN list_count(flatten(a)) = 16 AND list_count(flatten(b)) = 16 THEN
    [
        2 * atan2(sqrt(s), sqrt(greatest(8 - s, 0)))
        for s in [
            (a[1][1]::DOUBLE - b[1][1]) ** 2 + (a[1][2]::DOUBLE - b[1][2]) ** 2 + (a[1][3]::DOUBLE - b[1][3]) ** 2
            + (a[2][1]::DOUBLE - b[2][1]) ** 2 + (a[2][2]::DOUBLE - b[2][2]) ** 2 + (a[2][3]::DOUBLE - b[2][3]) ** 2
            + (a[3][1]::DOUBLE - b[3][1]) ** 2 + (a[3][2]::DOUBLE - b[3][2]) ** 2 + (a[3][3]::DOUBLE - b[3][3]) ** 2
        ]
    ][1] END;

-- Place of a site among the 20, from 1, as lists count in SQL.
-- site_index('index_tip')
CREATE MACRO site_index(site) AS
    CASE WHEN site IS NOT NULL THEN
        coalesce(
            list_position(site_names(), site),
            error('no site is called ' || site || '; there are ' || array_to_string(site_names(), ', '))
        )
    END;

-- Place of a digit among the five, thumb first, from 1.
-- digit_index('little')
CREATE MACRO digit_index(digit) AS
    CASE WHEN digit IS NOT NULL THEN
        coalesce(
            list_position(digit_names(), digit),
            error('no digit is called ' || digit || '; there are ' || array_to_string(digit_names(), ', '))
        )
    END;

-- Digit that a site is on.
-- digit_of('index_tip')
CREATE MACRO digit_of(site) AS
    digit_names()[(site_index(site) + 3) // 4];

-- Position of one site from a list of 20, as in frames.sites and grasps.sites_object [m].
-- (SELECT site_position(sites_object, 'index_tip') FROM grasps LIMIT 1)
CREATE MACRO site_position(sites, site) AS
    sites[site_index(site)];

-- Gap of one site from a list of 20, as in frames.gap and grasps.gap [m].
-- (SELECT to_mm(site_gap(gap, 'thumb_tip')) FROM grasps LIMIT 1)
CREATE MACRO site_gap(gap, site) AS
    gap[site_index(site)];

-- Least gap of the four sites of a digit from a list of 20 [m].
-- (SELECT to_mm(digit_gap(gap, 'thumb')) FROM grasps LIMIT 1)
CREATE MACRO digit_gap(gap, digit) AS
    list_min(gap[4 * digit_index(digit) - 3 : 4 * digit_index(digit)]);

-- Place of a joint angle among the 23, from 1.
-- joint_index('index_mcp_flexion')
CREATE MACRO joint_index(joint) AS
    CASE WHEN joint IS NOT NULL THEN
        coalesce(
            list_position(joint_names(), joint),
            error('no joint angle is called ' || joint || '; there are ' || array_to_string(joint_names(), ', '))
        )
    END;

-- All 23 joint angles of a configuration q, in the order of joint_names() [rad].
-- (SELECT joint_angles(q) FROM grasps LIMIT 1)
CREATE MACRO joint_angles(q) AS
    CASE WHEN len(q) = 30 THEN q[8:30] END;

-- One joint angle of a configuration q, by name [rad].
-- (SELECT to_deg(joint_angle(q, 'index_mcp_flexion')) FROM grasps LIMIT 1)
CREATE MACRO joint_angle(q, joint) AS
    q[7 + joint_index(joint)];

-- Standard deviation of one joint angle, from frames.q_sd [rad].
-- (SELECT to_deg(joint_angle_sd(q_sd, 'index_mcp_flexion')) FROM frames LIMIT 1)
CREATE MACRO joint_angle_sd(q_sd, joint) AS
    q_sd[6 + joint_index(joint)];

-- A list of digits or sites as one text, such as thumb+index.
-- digit_pattern(['thumb', 'index'])
CREATE MACRO digit_pattern(digits) AS
    array_to_string(digits, '+');

-- Digits of a text such as index+thumb, thumb first.
-- digits_of_pattern('index+thumb')
CREATE MACRO digits_of_pattern(pattern) AS
    [digit_names()[i] for i in list_sort([digit_index(trim(d)) for d in string_split(pattern, '+')])];

-- Share of what two lists hold together that both hold, 0 to 1 (intersection over union); null if both are empty.
-- overlap([1, 2, 3], [2, 3, 4])
CREATE MACRO overlap(a, b) AS
    CASE WHEN len(a) + len(b) > 0 THEN
        len(list_intersect(a, b)) / (len(a) + len(b) - len(list_intersect(a, b)))
    END;

-- Millimetres of metres.
-- to_mm(0.0125)
CREATE MACRO to_mm(metres) AS 1000 * metres;

-- Metres of millimetres.
-- from_mm(12.5)
CREATE MACRO from_mm(millimetres) AS millimetres / 1000;

-- Degrees of radians.
-- to_deg(pi() / 3)
CREATE MACRO to_deg(radians) AS degrees(radians);

-- Radians of degrees.
-- from_deg(60)
CREATE MACRO from_deg(degrees) AS radians(degrees);

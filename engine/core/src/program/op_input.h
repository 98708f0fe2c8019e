// Operations that read the shaded points.
#pragma once
#include "program/machine.h"
#include "shading/stage_math.h"

namespace glint {
namespace {
namespace op {

inline OnMesh on_mesh(const Machine& m, size_t k) {
  OnMesh p;
  for (size_t v = 0; v < 3; ++v) p.weights[v] = load(m.points.weights[v] + k);
  find_primitives(
      m.tables, [&](size_t lane) { return m.points.instance[k + lane]; },
      [&](size_t lane) { return m.points.primitive[k + lane]; }, p);
  return p;
}

inline void attribute(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const OnMesh p = on_mesh(m, k);
    if (at.wants(0)) at.put(0, k, read_color(m.tables, p, at.settings[0], GLINT_COLOR));
    if (at.wants(1)) at.put(1, k, read_color(m.tables, p, at.settings[0], GLINT_ALPHA).x);
  });
}

inline void uv(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Uvs uv = read_uv(m.tables, on_mesh(m, k), at.settings[0]);
    at.put(0, k, Three{uv.u, uv.v, Doubles{}});
  });
}

inline Three point3(const double (&columns)[3][kBlock], size_t k) {
  return {load(columns[0] + k), load(columns[1] + k), load(columns[2] + k)};
}

inline Three to_world(const ProgramView& view, const Three& x) {
  return (1 / splat(view.scale)) * x + splat3(view.origin);
}

/// Columns of the matrices of a group's instances, from number `first` on.
inline Three matrix_column(const Machine& m, size_t k, size_t first) {
  const auto part = [&](size_t c) {
    return each_lane(
        [&](size_t lane) { return m.tables.instances[m.points.instance[k + lane]].m[first + c]; });
  };
  return {part(0), part(1), part(2)};
}

inline void position(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, to_world(*m.tables.view, point3(m.points.x, k))); });
}

inline void normal(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, point3(m.points.n, k)); });
}

inline void face_normal(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, point3(m.points.g, k)); });
}

inline void incoming(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, -point3(m.points.d, k)); });
}

inline void backfacing(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, where(~load(m.points.outside + k), splat(1))); });
}

/// By Cramer's rule; zeros where the matrix has no inverse.
inline void object_position(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three a = matrix_column(m, k, 0), b = matrix_column(m, k, 3), c = matrix_column(m, k, 6);
    const Three p = point3(m.points.x, k) - matrix_column(m, k, 9), rows = cross(b, c);
    const Doubles size = dot(a, rows), over = choose(size != 0, splat(1) / size, splat(0));
    at.put(0, k, over * Three{dot(rows, p), dot(cross(c, a), p), dot(cross(a, b), p)});
  });
}

inline void object_normal(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three n = point3(m.points.n, k);
    at.put(0, k,
           unit(Three{dot(matrix_column(m, k, 0), n), dot(matrix_column(m, k, 3), n),
                      dot(matrix_column(m, k, 6), n)}));
  });
}

inline void object_location(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, to_world(*m.tables.view, matrix_column(m, k, 9))); });
}

/// Along the axes, which need not be orthogonal; the depth counts forward.
inline Three along_axes(const double (&axes)[3][3], const Three& p) {
  const Three u = splat3(axes[0]), v = splat3(axes[1]), w = splat3(axes[2]);
  const Doubles size = dot(u, cross(v, w));
  return {dot(cross(v, w), p) / size, dot(cross(w, u), p) / size, dot(cross(u, v), p) / size};
}

inline void camera_position(const Machine& m, const Operands& at) {
  const ProgramView& view = *m.tables.view;
  each_group(m, [&](size_t k) {
    const Three p = along_axes(view.axes, to_world(view, point3(m.points.x, k)) - splat3(view.eye));
    const auto size = [&](int axis) { return length(splat3(view.axes[axis])); };
    at.put(0, k, Three{size(0) * p.x, size(1) * p.y, -(size(2) * p.z)});
  });
}

inline void window(const Machine& m, const Operands& at) {
  const ProgramView& view = *m.tables.view;
  const double* w = view.window;
  each_group(m, [&](size_t k) {
    const Three p = along_axes(view.axes, to_world(view, point3(m.points.x, k)) - splat3(view.eye));
    const Doubles depth = view.parallel ? splat(1) : choose(p.z != 0, -p.z, splat(1));
    at.put(0, k,
           Three{(p.x / depth - w[0]) / (w[1] - w[0]), (p.y / depth - w[2]) / (w[3] - w[2]),
                 Doubles{}});
  });
}

inline void reflection(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three n = point3(m.points.n, k), d = point3(m.points.d, k);
    at.put(0, k, d - (2 * dot(n, d)) * n);
  });
}

inline Doubles reflectance(const Machine& m, const Operands& at, size_t k, Doubles relative) {
  return fresnel_reflectance(magnitude(dot(point3(m.points.d, k), at.vector(1, k))), relative);
}

inline void fresnel(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Doubles index = larger(at.number(0, k), splat(1e-5));
    at.put(0, k,
           reflectance(m, at, k, choose(load(m.points.outside + k), index, splat(1) / index)));
  });
}

inline void layer_weight(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Doubles blend = at.number(0, k), index = larger(1 - blend, splat(1e-5));
    at.put(0, k,
           reflectance(m, at, k, choose(load(m.points.outside + k), splat(1) / index, index)));
    if (!at.wants(1)) return;
    const Doubles held = smaller(larger(blend, splat(0)), splat(1 - 1e-5));
    const Doubles exponent = choose(held < 0.5, 2 * held, 0.5 / (1 - held));
    const Doubles cosine =
        smaller(magnitude(dot(point3(m.points.d, k), at.vector(1, k))), splat(1));
    const Doubles rest = choose(exponent > 0, grazing_power(1 - cosine, exponent), splat(1));
    at.put(1, k, 1 - rest);
  });
}

inline void light_path(const Machine& m, const Operands& at) {
  const auto is = [&](RayKind kind) { return splat(m.kind == kind ? 1 : 0); };
  each_group(m, [&](size_t k) {
    at.put(0, k, is(RayKind::kCamera));
    at.put(1, k, is(RayKind::kShadow));
    at.put(2, k, is(RayKind::kBounced));
  });
}

inline void image(const Machine& m, const Operands& at) {
  const TextureShape& t = m.tables.textures[at.settings[0]];
  each_group(m, [&](size_t k) {
    const Three uv = at.vector(0, k);
    if (at.wants(0)) at.put(0, k, sample<colors>(t, uv.x, uv.y));
    if (at.wants(1)) at.put(1, k, sample<alphas>(t, uv.x, uv.y));
  });
}

}  // namespace op
}  // namespace
}  // namespace glint

// Operations that read the shaded points.
#pragma once
#include <iterator>
#include <limits>

#include "program/machine.h"
#include "shading/panorama.h"
#include "shading/stage_math.h"

namespace glint {
namespace {
namespace op {

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

/// Two unit vectors across a unit one and each other, as Cycles has them: bumps at the edges of
/// patterns show which way they point. The first is across (1, 1, 1), or (-1, 1, 1) where g is
/// along that but for rounding.
inline Three axis_across(const Three& g, int number) {
  const auto along = magnitude(g.x - g.y) + magnitude(g.x - g.z) < 1e-6;
  const Three first = unit(choose(along, Three{g.z - g.y, g.x + g.z, -g.x - g.y},
                                  Three{g.z - g.y, g.x - g.z, g.y - g.x}));
  return number == 1 ? first : cross(g, first);
}

inline Three along_axes(const double (&axes)[3][3], const Three& p) {
  const Three u = splat3(axes[0]), v = splat3(axes[1]), w = splat3(axes[2]);
  const Doubles size = dot(u, cross(v, w));
  return {dot(cross(v, w), p) / size, dot(cross(w, u), p) / size, dot(cross(u, v), p) / size};
}

/// What a tenth of a pixel spans at a point of a perspective view, from the eye to it: the mean of
/// both directions in the picture.
inline Doubles tenth_of_pixel(const ProgramView& view, const Three& from_eye) {
  const Three p = along_axes(view.axes, from_eye);
  const auto size = [&](int axis) { return length(splat3(view.axes[axis])); };
  const Doubles x = size(0) * p.x, y = size(1) * p.y, far = length(from_eye),
                z = larger(-(size(2) * p.z), 0.25 * far),
                wide = 0.5 * (root(z * z + x * x) + root(z * z + y * y));
  return choose(far > 0, view.step * wide * z / far, splat(0));
}

/// The step in anchored space to where a shifted read happens (Shift of operations_input.py).
inline Three step_of(const Machine& m, size_t k, int shift) {
  const int axis = shift & 3, width = shift >> 2;
  if (axis == 0) return Three{};
  const ProgramView& view = *m.tables.view;
  Doubles size = splat(view.step * view.scale);
  if (!view.parallel) {
    const Three from_eye =
        point3(m.points.x, k) - splat(view.scale) * (splat3(view.eye) - splat3(view.origin));
    size = view.panorama ? view.step * length(from_eye) : tenth_of_pixel(view, from_eye);
  }
  if (width != 0) size = size * (width / 100.0);
  return size * axis_across(point3(m.points.g, k), axis);
}

inline Three shifted_point(const Machine& m, size_t k, int shift) {
  return point3(m.points.x, k) + step_of(m, k, shift);
}

/// The edges of a group's triangles in anchored space; zero of what is no mesh.
struct Edges {
  Three e, f;
  Edges(const Machine& m, size_t k) {
    double edge[6][kLanes] = {};
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const InstanceShape& shape = m.tables.instances[m.points.instance[k + lane]];
      const GlintGeometry& g = m.tables.geometries[m.tables.groups[shape.group].geometry];
      if (!g.triangles) continue;
      const uint32_t* rows = g.triangles + 3 * size_t(m.points.primitive[k + lane]);
      const float *a = g.vertices + 3 * size_t(rows[0]), *b = g.vertices + 3 * size_t(rows[1]),
                  *c = g.vertices + 3 * size_t(rows[2]);
      for (size_t i = 0; i < 3; ++i) {
        const double p = double(b[i]) - double(a[i]), q = double(c[i]) - double(a[i]);
        for (size_t to = 0; to < 3; ++to) {
          edge[to][lane] += p * shape.m[3 * i + to];
          edge[3 + to][lane] += q * shape.m[3 * i + to];
        }
      }
    }
    e = {load(edge[0]), load(edge[1]), load(edge[2])};
    f = {load(edge[3]), load(edge[4]), load(edge[5])};
  }
};

/// Barycentric weights after a step in the plane of the triangle; sided: the other way on its inner
/// side, as in Cycles what meshes store is read.
inline void shift_weights(const Machine& m, size_t k, int shift, bool sided, OnMesh& p) {
  const Edges edges(m, k);
  const Doubles side = choose(load(m.points.outside + k), splat(1), splat(sided ? -1 : 1));
  const Three d = side * step_of(m, k, shift);
  const Doubles ee = dot(edges.e, edges.e), ef = dot(edges.e, edges.f), ff = dot(edges.f, edges.f),
                ed = dot(edges.e, d), fd = dot(edges.f, d), size = ee * ff - ef * ef;
  const Doubles over = choose(size > 0, splat(1) / choose(size > 0, size, splat(1)), splat(0));
  const Doubles u = over * (ff * ed - ef * fd), v = over * (ee * fd - ef * ed);
  p.weights[0] = p.weights[0] - u - v;
  p.weights[1] = p.weights[1] + u;
  p.weights[2] = p.weights[2] + v;
}

inline OnMesh on_mesh(const Machine& m, size_t k, int shift, bool sided = true) {
  OnMesh p;
  for (size_t v = 0; v < 3; ++v) p.weights[v] = load(m.points.weights[v] + k);
  if (shift != 0) shift_weights(m, k, shift, sided, p);
  find_primitives(
      m.tables, [&](size_t lane) { return m.points.instance[k + lane]; },
      [&](size_t lane) { return m.points.primitive[k + lane]; }, p);
  return p;
}

inline void attribute(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const OnMesh p = on_mesh(m, k, at.settings[1]);
    if (at.wants(0)) at.put(0, k, read_color(m.tables, p, at.settings[0], GLINT_COLOR));
    if (at.wants(1)) at.put(1, k, read_color(m.tables, p, at.settings[0], GLINT_ALPHA).x);
  });
}

inline void uv(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Uvs uv = read_uv(m.tables, on_mesh(m, k, at.settings[1]), at.settings[0]);
    at.put(0, k, Three{uv.u, uv.v, Doubles{}});
  });
}

inline void position(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    at.put(0, k, to_world(*m.tables.view, shifted_point(m, k, at.settings[0])));
  });
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

/// Where a ray of the camera went before an eye of a pair turned it.
inline Three unturned(const Machine& m, size_t k) {
  const ProgramView& view = *m.tables.view;
  const Three d = point3(m.points.d, k);
  if (!(view.convergence < __builtin_inf())) return d;
  const Three hit = to_world(view, point3(m.points.x, k)) - splat3(view.eye);
  const Three aside = hit - load(m.points.length + k) * d;
  return unit(root(view.convergence * view.convergence + dot(aside, aside)) * d + aside);
}

inline void ray_length(const Machine& m, const Operands& at) {
  const ProgramView& view = *m.tables.view;
  each_group(m, [&](size_t k) {
    Doubles length = load(m.points.length + k);
    if (m.kind == RayKind::kCamera) {
      const Three back = splat3(view.axes[2]);
      length =
          length + (view.panorama ? splat(-view.clip_start)
                                  : view.clip_start * dot(back, back) / dot(back, unturned(m, k)));
    }
    at.put(0, k, length);
  });
}

inline void backfacing(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, where(~load(m.points.outside + k), splat(1))); });
}

/// By Cramer's rule; zeros where the matrix has no inverse.
inline void object_position(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three a = matrix_column(m, k, 0), b = matrix_column(m, k, 3), c = matrix_column(m, k, 6);
    const Three p = shifted_point(m, k, at.settings[0]) - matrix_column(m, k, 9),
                rows = cross(b, c);
    const Doubles size = dot(a, rows), over = choose(size != 0, splat(1) / size, splat(0));
    at.put(0, k, over * Three{dot(rows, p), dot(cross(c, a), p), dot(cross(a, b), p)});
  });
}

inline Three object_normal_of(const Machine& m, size_t k) {
  const Three n = point3(m.points.n, k);
  return unit(Three{dot(matrix_column(m, k, 0), n), dot(matrix_column(m, k, 3), n),
                    dot(matrix_column(m, k, 6), n)});
}

inline void object_normal(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, object_normal_of(m, k)); });
}

inline void object_location(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, to_world(*m.tables.view, matrix_column(m, k, 9))); });
}

inline void instance_value(const Machine& m, const Operands& at) {
  const InstanceValues& values = *m.tables.values;
  const float* rows = values.of(at.settings[0]);
  each_group(m, [&](size_t k) {
    const auto part = [&](size_t c) {
      return each_lane([&](size_t lane) {
        const Placement& p = values.placements[m.points.instance[k + lane]];
        return rows ? double(rows[4 * size_t(p.row) + c]) : 0.0;
      });
    };
    if (at.wants(0)) at.put(0, k, Three{part(0), part(1), part(2)});
    if (at.wants(1)) at.put(1, k, part(3));
  });
}

/// Along the axes, which need not be orthogonal; the depth counts forward.
inline void camera_position(const Machine& m, const Operands& at) {
  const ProgramView& view = *m.tables.view;
  each_group(m, [&](size_t k) {
    const Three p = along_axes(
        view.axes, to_world(view, shifted_point(m, k, at.settings[0])) - splat3(view.eye));
    const auto size = [&](int axis) { return length(splat3(view.axes[axis])); };
    at.put(0, k, Three{size(0) * p.x, size(1) * p.y, -(size(2) * p.z)});
  });
}

inline void window(const Machine& m, const Operands& at) {
  const ProgramView& view = *m.tables.view;
  const double* w = view.window;
  each_group(m, [&](size_t k) {
    const Three p = along_axes(
        view.axes, to_world(view, shifted_point(m, k, at.settings[0])) - splat3(view.eye));
    if (view.panorama) {
      const PicturePoint here = picture_point(*view.panorama, unit(p));
      at.put(0, k,
             Three{(here.u - w[0]) / (w[1] - w[0]), (here.v - w[2]) / (w[3] - w[2]), Doubles{}});
      return;
    }
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
  const RayKind kind = m.kind;
  const bool is[] = {kind == RayKind::kCamera, kind >= RayKind::kShadow,
                     kind == RayKind::kBounced || kind == RayKind::kShadowBounced,
                     kind == RayKind::kShadowScattered};
  each_group(m, [&](size_t k) {
    for (size_t i = 0; i < std::size(is); ++i) at.put(i, k, splat(is[i]));
  });
}

inline void ray_depth(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Mask tags = load(m.points.tags + k);
    const auto part = [&](int first, int64_t bits) {
      return __builtin_convertvector(tags >> first & bits, Doubles);
    };
    at.put(0, k, part(RayTag::kDepth, 255));
    at.put(1, k, part(RayTag::kStraight, 255));
    at.put(2, k, part(RayTag::kRefractions, RayTag::kMostRefractions));
    at.put(3, k, part(RayTag::kRefracted, 1));
  });
}

/// Unit normals of the object's space, outward, in the world.
inline Three normal_to_world(const Machine& m, size_t k, const Three& n) {
  const auto column = [&](size_t first) {
    const auto part = [&](size_t c) {
      return each_lane([&](size_t lane) {
        return m.tables.instances[m.points.instance[k + lane]].normal[first + c];
      });
    };
    return Three{part(0), part(1), part(2)};
  };
  return unit(n.x * column(0) + n.y * column(3) + n.z * column(6));
}

inline void normal_to_world(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, normal_to_world(m, k, at.vector(0, k))); });
}

inline Three camera_axis(const ProgramView& view, int axis) {
  const Three column = splat3(view.axes[axis]);
  return unit(axis == 2 ? -column : column);
}

/// To the world from the object's axes, as a point or not.
inline Three from_object(const Machine& m, size_t k, const Three& v, bool is_point) {
  const Three p =
      v.x * matrix_column(m, k, 0) + v.y * matrix_column(m, k, 3) + v.z * matrix_column(m, k, 6);
  const ProgramView& view = *m.tables.view;
  return is_point ? to_world(view, p + matrix_column(m, k, 9)) : (1 / splat(view.scale)) * p;
}

/// By Cramer's rule; zeros where the matrix has no inverse.
inline Three to_object(const Machine& m, size_t k, const Three& v, bool is_point) {
  const ProgramView& view = *m.tables.view;
  const Three a = matrix_column(m, k, 0), b = matrix_column(m, k, 3), c = matrix_column(m, k, 6);
  const Three p = is_point ? splat(view.scale) * (v - splat3(view.origin)) - matrix_column(m, k, 9)
                           : splat(view.scale) * v,
              rows = cross(b, c);
  const Doubles size = dot(a, rows), over = choose(size != 0, splat(1) / size, splat(0));
  return over * Three{dot(rows, p), dot(cross(c, a), p), dot(cross(a, b), p)};
}

inline Three from_camera(const ProgramView& view, const Three& v, bool is_point) {
  const Three p =
      v.x * camera_axis(view, 0) + v.y * camera_axis(view, 1) + v.z * camera_axis(view, 2);
  return is_point ? p + splat3(view.eye) : p;
}

inline Three to_camera(const ProgramView& view, const Three& v, bool is_point) {
  const Three u = camera_axis(view, 0), w = camera_axis(view, 1), f = camera_axis(view, 2),
              p = is_point ? v - splat3(view.eye) : v;
  const Doubles size = dot(u, cross(w, f));
  return {dot(cross(w, f), p) / size, dot(cross(f, u), p) / size, dot(cross(u, w), p) / size};
}

inline Three normal_to_object(const Machine& m, size_t k, const Three& n) {
  return unit(Three{dot(matrix_column(m, k, 0), n), dot(matrix_column(m, k, 3), n),
                    dot(matrix_column(m, k, 6), n)});
}

inline void transform_vector(const Machine& m, const Operands& at) {
  enum { kPoint, kVector, kNormal };
  enum { kWorld, kObject, kCamera };
  const bool is_point = at.settings[0] == kPoint, is_normal = at.settings[0] == kNormal;
  const int from = at.settings[1], to = at.settings[2];
  const ProgramView& view = *m.tables.view;
  each_group(m, [&](size_t k) {
    Three v = at.vector(0, k);
    if (from != to) {
      if (from == kCamera) v = from_camera(view, v, is_point);
      if (from == kObject)
        v = is_normal ? normal_to_world(m, k, v) : from_object(m, k, v, is_point);
      if (to == kCamera) v = to_camera(view, v, is_point);
      if (to == kObject) v = is_normal ? normal_to_object(m, k, v) : to_object(m, k, v, is_point);
    }
    at.put(0, k, is_normal ? unit(v) : v);
  });
}

/// Which of a group's points are on triangles.
inline Mask on_triangles(const OnMesh& p) {
  Mask flat{};
  for (size_t lane = 0; lane < kLanes; ++lane)
    flat[lane] = p.geometry[p.different == 1 ? 0 : lane]->triangles ? -1 : 0;
  return flat;
}

inline void pixel_step(const Machine& m, const Operands& at) {
  const Doubles over = splat(1 / m.tables.view->scale);
  each_group(m, [&](size_t k) { at.put(0, k, over * step_of(m, k, at.settings[0])); });
}

inline void edge_distance(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const OnMesh p = on_mesh(m, k, at.settings[0], false);
    const Edges edges(m, k);
    const Doubles area = length(cross(edges.e, edges.f));
    const Doubles apart[3] = {magnitude(p.weights[0]) * area / length(edges.f - edges.e),
                              magnitude(p.weights[1]) * area / length(edges.f),
                              magnitude(p.weights[2]) * area / length(edges.e)};
    at.put(0, k,
           choose(on_triangles(p),
                  smaller(smaller(apart[0], apart[1]), apart[2]) / m.tables.view->scale,
                  splat(double(std::numeric_limits<float>::max()))));
  });
}

inline void barycentric(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const OnMesh p = on_mesh(m, k, at.settings[0]);
    const Mask flat = on_triangles(p);
    at.put(0, k,
           Three{where(flat, p.weights[0]), where(flat, p.weights[1]), where(flat, p.weights[2])});
  });
}

/// A colour, brought to -1 to 1, as a normal along the tangent that the attribute is.
inline Three along_tangent(const Machine& m, const Operands& at, size_t k, const Three& c,
                           Doubles strength) {
  const OnMesh p = on_mesh(m, k, 0);
  const Doubles side = choose(load(m.points.outside + k), splat(1), splat(-1));
  const Three n = side * object_normal_of(m, k),
              t = read_color(m.tables, p, at.settings[1], GLINT_COLOR);
  const Doubles sign = read_color(m.tables, p, at.settings[1], GLINT_ALPHA).x;
  const Doubles up = 1 + smaller(strength, splat(1)) * (c.z - 1);
  const Three bent = unit(strength * (c.x * t + (c.y * sign) * cross(n, t)) + up * n);
  const Three found = side * normal_to_world(m, k, bent);
  return choose(nonzero(t) & nonzero(found), found, point3(m.points.n, k));
}

inline void normal_map(const Machine& m, const Operands& at) {
  enum { kTangent, kObject, kWorld, kBlenderObject, kBlenderWorld };
  const int space = at.settings[0];
  each_group(m, [&](size_t k) {
    Three c = splat(2) * at.vector(0, k) - Three{splat(1), splat(1), splat(1)};
    const Doubles strength = larger(at.number(1, k), splat(0));
    if (space == kTangent) return at.put(0, k, along_tangent(m, at, k, c, strength));
    if (space >= kBlenderObject) c = {c.x, -c.y, -c.z};
    const bool turns = space == kObject || space == kBlenderObject;
    const Doubles side = choose(load(m.points.outside + k), splat(1), splat(-1));
    const Three bent = side * (turns ? normal_to_world(m, k, unit(c)) : unit(c));
    const Three own = point3(m.points.n, k), mixed = unit(own + strength * (bent - own));
    at.put(0, k, choose(nonzero(mixed), mixed, own));
  });
}

/// Mikkelsen, "Surface gradient-based bump mapping framework" (2020).
inline void bump(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const int width = at.settings[0];
    const Three one = step_of(m, k, 1 + 4 * width), two = step_of(m, k, 2 + 4 * width),
                n = at.vector(5, k);
    const Three across = cross(two, n), along = cross(n, one);
    const Doubles h = at.number(0, k), size = dot(one, across);
    const Doubles world = splat(1) / m.tables.view->scale;  // heights are in the world's units
    const Three gradient = (at.number(1, k) - h) * across + (at.number(2, k) - h) * along;
    const Doubles distance = at.number(4, k) * with_sign(splat(1), size);
    const Three bent = unit((world * magnitude(size)) * n - distance * gradient);
    const Doubles held = larger(at.number(3, k), splat(0));
    const Three mixed = unit(held * bent + (1 - held) * n);
    at.put(0, k, choose(nonzero(mixed), mixed, n));
  });
}

__attribute__((flatten)) inline void image(const Machine& m, const Operands& at) {
  const TextureShape& t = m.tables.textures[at.settings[0]];
  each_group(m, [&](size_t k) {
    const Three uv = at.vector(0, k);
    if (at.wants(0)) at.put(0, k, sample_color(t, uv.x, uv.y));
    if (at.wants(1)) at.put(1, k, sample_alpha(t, uv.x, uv.y));
  });
}

}  // namespace op
}  // namespace
}  // namespace glint

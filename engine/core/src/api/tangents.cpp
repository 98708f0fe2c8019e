// Tangents of UV maps: those of Mikkelsen, Simulation of wrinkled surfaces revisited (2008), as
// engine/tangents.py has them, sum by sum in its order, so that bits are the same.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "api/guard.h"
#include "glint.h"
#include "math/math.h"
#include "math/vec.h"

namespace {

using glint::dot;
using glint::Vec3d;

/// What corners have in common that share a tangent, as bits.
using Shared = std::array<uint64_t, 7>;

Vec3d unit_or_zero(const Vec3d& a) {
  const double length = std::sqrt(dot(a, a)), over = length > 0 ? length : 1.0;
  return {a[0] / over, a[1] / over, a[2] / over};
}

/// In the plane of a normal.
Vec3d laid(const Vec3d& a, const Vec3d& normal) { return a - dot(normal, a) * normal; }

Vec3d three(const double* values, size_t row) {
  return {values[3 * row], values[3 * row + 1], values[3 * row + 2]};
}

/// As engine/linear/elementary.py has it.
double arccos(double x) {
  const double size = std::fabs(x);
  double t = std::sqrt((1 - size) / (1 + size));
  for (int k = 0; k < 3; ++k) t = t / (1 + std::sqrt(1 + t * t));
  const double square = t * t;
  double series = 0;
  for (int n = 21; n > 1; n -= 2) series = square * (1.0 / n - series);
  const double angle = 16 * (t - t * series);
  return x < 0 ? glint::kPi - angle : angle;
}

/// A number for each of what corners share, by open addressing.
class Groups {
 public:
  explicit Groups(size_t most)
      : places_(std::bit_ceil(2 * most + 2), kNone), mask_(places_.size() - 1) {
    found_.reserve(most);
  }
  uint32_t of(const Shared& shared) {
    uint64_t key = 0;
    for (uint64_t word : shared) {
      key = (key ^ word) * 0x9E3779B97F4A7C15;  // Knuth, The Art of Computer Programming 3, 6.4
      key ^= key >> 32;
    }
    for (uint64_t at = key & mask_;; at = (at + 1) & mask_) {
      uint32_t& place = places_[at];
      if (place == kNone) {
        place = uint32_t(found_.size());
        found_.push_back(shared);
        return place;
      }
      if (found_[place] == shared) return place;
    }
  }
  size_t count() const { return found_.size(); }

 private:
  static constexpr uint32_t kNone = ~0u;
  std::vector<uint32_t> places_;
  uint64_t mask_;
  std::vector<Shared> found_;
};

struct Corner {
  uint32_t group;
  Vec3d along;  // weighed
};

uint64_t bits_of(double x) { return std::bit_cast<uint64_t>(x + 0.0); }  // one zero

/// The corners of a triangle, and the sign of its bitangent.
double read_triangle(const GlintTangentData& d, size_t triangle, Groups& groups, Corner* corners) {
  const uint32_t *const vertex = d.triangles + 3 * triangle, *const own = d.corners + 3 * triangle;
  Vec3d edges[3], normals[3];
  double s[3], t[3];
  for (size_t k = 0; k < 3; ++k) {
    const size_t next = (k + 1) % 3;
    edges[k] = three(d.vertices, vertex[next]) - three(d.vertices, vertex[k]);
    normals[k] = three(d.normals, 3 * triangle + k);
    s[k] = d.uv[2 * size_t(own[next])] - d.uv[2 * size_t(own[k])];
    t[k] = d.uv[2 * size_t(own[next]) + 1] - d.uv[2 * size_t(own[k]) + 1];
  }
  const double area = s[2] * t[0] - s[0] * t[2], sign = area > 0 ? 1.0 : -1.0;
  const Vec3d across = unit_or_zero(sign * (t[0] * edges[2] - t[2] * edges[0]));
  for (size_t k = 0; k < 3; ++k) {
    const Vec3d& n = normals[k];
    const Vec3d ahead = unit_or_zero(laid(edges[k], n)),
                back = unit_or_zero(laid(-edges[(k + 2) % 3], n));
    const double cosine = dot(ahead, back),
                 held = cosine < -1  ? -1
                        : cosine > 1 ? 1
                                     : cosine,
                 weight = arccos(held) * (area != 0 ? 1.0 : 0.0);
    const double u = d.uv[2 * size_t(own[k])], v = d.uv[2 * size_t(own[k]) + 1];
    corners[k] = {groups.of({bits_of(vertex[k]), bits_of(u), bits_of(v), bits_of(n[0]),
                             bits_of(n[1]), bits_of(n[2]), bits_of(sign)}),
                  weight * unit_or_zero(laid(across, n))};
  }
  return sign;
}

bool is_in_range(const GlintTangentData& d) {
  const auto below = [&](const uint32_t* rows, uint64_t count) {
    return std::all_of(rows, rows + 3 * d.count, [&](uint32_t row) { return row < count; });
  };
  return below(d.triangles, d.vertex_count) && below(d.corners, d.corner_count) &&
         d.count < 1u << 30;
}

void find_tangents(const GlintTangentData& d, float* out) {
  Groups groups(3 * d.count);
  std::vector<Corner> corners(3 * d.count);
  std::fill_n(out, 4 * d.corner_count, 1.0f);
  for (size_t k = 0; k < d.count; ++k) {
    const double sign = read_triangle(d, k, groups, corners.data() + 3 * k);
    for (size_t c = 0; c < 3; ++c) out[4 * size_t(d.corners[3 * k + c]) + 3] = float(sign);
  }
  std::vector<Vec3d> total(groups.count()), sums(d.corner_count);
  for (const Corner& corner : corners) total[corner.group] += corner.along;
  for (Vec3d& sum : total) sum = unit_or_zero(sum);
  for (size_t k = 0; k < corners.size(); ++k) sums[d.corners[k]] += total[corners[k].group];
  for (size_t k = 0; k < sums.size(); ++k) {
    const Vec3d tangent = unit_or_zero(sums[k]);
    for (int c = 0; c < 3; ++c) out[4 * k + size_t(c)] = float(tangent[c]);
  }
}

}  // namespace

int32_t glint_tangents(const GlintTangentData* data, float* out) {
  return glint::guarded(-1, nullptr, 0, [&] {
    if (!is_in_range(*data)) return -2;
    find_tangents(*data, out);
    return 0;
  });
}

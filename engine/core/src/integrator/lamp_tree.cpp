#include "integrator/lamp_tree.h"

#include <algorithm>
#include <cmath>

namespace glint {
namespace {

using Lamps = const ClusteredLamp*;

double brightness(const Vec3d& color) { return color.x + color.y + color.z; }

void set(double (&to)[3], const Vec3d& v) {
  for (int c = 0; c < 3; ++c) to[c] = v[c];
}

/// The middle of the light, the sum of it, and a ball round the lamps.
void bound(LampCluster& cluster, Lamps begin, Lamps end) {
  Vec3d color{}, middle{};
  double all = 0, reach = 0;
  for (Lamps lamp = begin; lamp != end; ++lamp) {
    color = color + lamp->light->color;
    all += brightness(lamp->light->color);
  }
  for (Lamps lamp = begin; lamp != end; ++lamp)
    middle = middle + brightness(lamp->light->color) / all * lamp->light->center;
  if (end - begin == 1) middle = begin->light->center;
  for (Lamps lamp = begin; lamp != end; ++lamp)
    reach = std::max(reach, length(lamp->light->center - middle) + lamp->light->radius);
  set(cluster.color, color);
  set(cluster.center, middle);
  cluster.radius2 = reach * reach;
}

/// Adds the share `part` of the light, of a lamp at `off` from the middle.
void add_moments(LampCluster& cluster, int channel, double part, const Vec3d& off, double disc) {
  double* const quadrupole = cluster.quadrupole[channel];
  int k = 0;
  for (int i = 0; i < 3; ++i) {
    cluster.dipole[channel][i] += part * off[i];
    for (int j = i; j < 3; ++j) quadrupole[k++] += part * off[i] * off[j];
  }
  cluster.trace[channel] += part * (1.5 * dot(off, off) + disc);
}

bool is_grey(const Vec3d& color, const Vec3d& other) {
  const double a = brightness(color), b = brightness(other);
  for (int c = 0; c < 3; ++c)
    if (std::fabs(color[c] / a - other[c] / b) > 1e-12) return false;
  return true;
}

/// A disc that faces what it lights is seen as bright as from 1 / sqrt(d^2 + r^2).
void find_moments(LampCluster& cluster, Lamps begin, Lamps end) {
  const Vec3d color{cluster.color[0], cluster.color[1], cluster.color[2]},
      middle{cluster.center[0], cluster.center[1], cluster.center[2]};
  const bool grey = std::all_of(
      begin, end, [&](const ClusteredLamp& lamp) { return is_grey(lamp.light->color, color); });
  cluster.moments = grey ? 1 : 3;
  if (end - begin == 1 && !begin->is_disc) cluster.moments = 0;
  for (Lamps lamp = begin; lamp != end; ++lamp) {
    const Light& light = *lamp->light;
    for (int channel = 0; channel < cluster.moments; ++channel) {
      const double part = grey                 ? brightness(light.color) / brightness(color)
                          : color[channel] > 0 ? light.color[channel] / color[channel]
                                               : 0;
      add_moments(cluster, channel, part, light.center - middle,
                  lamp->is_disc ? light.radius * light.radius : 0);
    }
  }
}

/// The lamp of the highest level but the first; of several the one nearest to the middle.
Lamps parting(Lamps begin, Lamps end) {
  const Lamps middle = begin + (end - begin) / 2;
  Lamps best = middle;
  for (Lamps lamp = begin + 1; lamp != end; ++lamp) {
    const int higher = lamp->light->level - best->light->level;
    if (higher > 0 || (higher == 0 && std::abs(lamp - middle) < std::abs(best - middle)))
      best = lamp;
  }
  return best;
}

void add(std::vector<LampCluster>& clusters, Lamps begin, Lamps end) {
  const size_t number = clusters.size();
  LampCluster cluster{};
  cluster.first = begin->first;
  cluster.end = end[-1].end;
  cluster.last = end[-1].last;
  bound(cluster, begin, end);
  find_moments(cluster, begin, end);
  clusters.push_back(cluster);
  if (end - begin > 1) {
    const Lamps at = parting(begin, end);
    add(clusters, begin, at);
    add(clusters, at, end);
  }
  clusters[number].next = uint32_t(clusters.size());
}

}  // namespace

std::vector<LampCluster> clusters_of(const std::vector<ClusteredLamp>& lamps) {
  std::vector<LampCluster> clusters;
  if (!lamps.empty()) add(clusters, lamps.data(), lamps.data() + lamps.size());
  return clusters;
}

}  // namespace glint

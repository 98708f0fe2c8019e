// Passes of light by the kind of surface that gives it back first, and by the group of what makes
// it (semantics/passes.md).
#include "integrator/tracer.h"

namespace glint {

/// What of light the surfaces that camera rays meet give back, of each kind.
void Tracer::note_colors(const Queue& queue) {
  const auto add = [&](int pass, size_t k, Vec3d color) {
    double* const sums = paths_.sums(film_, pass);
    for (size_t c = 0; sums && c < 3; ++c)
      sums[c * paths_.stride() + queue.slot(k)] += color[int(c)];
  };
  const auto add_sharp = [&](int number, size_t k, Vec3d color) {
    double* const sums = paths_.guide(film_, kSharpColor + number);
    if (sums) sums[queue.slot(k)] += color.x + color.y + color.z;
  };
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.material[k] >= scene_.materials.size() || is_caught(queue, k)) continue;
    const Vec3d T = queue.path(k).T;
    const Gives gives = shader_.gives(batch_, k);
    Vec3d glossy = T * gives.mirrored;
    if (batch_.lit[k]) {
      const Highlights given = highlights(k);
      add(GLINT_PASS_DIFFUSE_COLOR, k, row(batch_.diffuse, k) + given.matt + given.fibre);
      glossy += given.glossy;
    }
    if (batch_.translucent[0]) add(GLINT_PASS_DIFFUSE_COLOR, k, row(batch_.translucent, k));
    add(GLINT_PASS_GLOSSY_COLOR, k, glossy);
    add(GLINT_PASS_TRANSMISSION_COLOR, k, T * gives.refracted);
    add_sharp(0, k, T * gives.mirrored);
    add_sharp(1, k, T * gives.clear);
    if (any(gives.refracted - gives.clear)) paths_.rough_glass()[queue.slot(k)] = 1;
  }
}

/// Lights the points of the batch, and tells the passes of the paths what lights would give to the
/// surfaces that camera rays meet if nothing hid them: that is what the parts by lobes grow by, as
/// shadows are a part of their own.
void Tracer::illuminate(const Queue& queue) {
  const SumColumns& s = batch_.sums;
  const auto note = [&](double sign) {
    if (queue.visibility != kCamera || queue.exits) return;
    for (const auto& [pass, columns] :
         {std::pair{int(kUnshadowedDiffuse), s.diffuse}, {int(kUnshadowedGloss), s.specular}})
      for (size_t c = 0; film_.column_of(pass) >= 0 && c < 3; ++c) {
        double* const sums = paths_.sums(film_, pass) + c * paths_.stride();
        for (size_t k = 0; k < queue.size(); ++k)
          if (!is_caught(queue, k)) sums[queue.slot(k)] += sign * columns[c][k];
      }
  };
  note(-1);
  direct_.illuminate(batch_, sample_);
  note(1);
}

/// Where light goes that ray k brings by way of others: `blurred` unless mirrors or clear glass
/// show it.
int Tracer::image_of(const Queue& queue, size_t k, int blurred) {
  if (queue.is_gloss() ||
      film_.column_of(kMirroredLight) < 0 && film_.column_of(kRefractedLight) < 0)
    return blurred;
  const bool through = queue.transmitted(k);
  if (through && paths_.rough_glass()[queue.slot(k)]) return blurred;
  const int image = through ? kRefractedLight : kMirroredLight;
  return film_.column_of(image) < 0 ? blurred : image;
}

/// What tells the surfaces that mirrors and clear glass show, and their colours.
void Tracer::note_images(const Queue& queue) {
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.material[k] >= scene_.materials.size()) continue;
    const int image = image_of(queue, k, -1);
    if (image < 0) continue;
    Vec3d color;
    if (batch_.lit[k]) {
      const Highlights given = highlights(k);
      color = row(batch_.diffuse, k) + given.matt + given.glossy;
    }
    if (batch_.translucent[0]) color += row(batch_.translucent, k);
    if (!any(color)) continue;
    double* const colors = paths_.sums(film_, image + 1) + queue.slot(k);
    for (size_t c = 0; c < 3; ++c) colors[c * paths_.stride()] += color[int(c)];
    const GuideSet set = image == kMirroredLight ? kInMirrors : kBehindGlass;
    add_guides(queue, k, set, mean(queue.path(k).T));
  }
}

/// The batch's light to the passes of the paths: straight from where it is made, or by way of other
/// surfaces.
void Tracer::keep_lighting(const Queue& queue) {
  const SumColumns& s = batch_.sums;
  const auto add = [&](int pass, size_t c, size_t k, double light) {
    double* const sums = paths_.sums(film_, pass);
    if (sums) sums[c * paths_.stride() + queue.slot(k)] += light;
  };
  const auto kept = [&](int pass, int instead) {
    return film_.column_of(pass) < 0 ? instead : pass;
  };
  const int other_diffuse = kept(kOtherDiffuse, GLINT_PASS_DIFFUSE_DIRECT),
            other_gloss = kept(kOtherGloss, GLINT_PASS_GLOSSY_DIRECT);
  for (size_t c = 0; c < 3; ++c)
    for (size_t k = 0; k < queue.size(); ++k) {
      if (queue.visibility == kCamera) {
        add(other_diffuse, c, k, s.ambient[c][k]);
        add(queue.exits ? other_diffuse : GLINT_PASS_DIFFUSE_DIRECT, c, k,
            batch_.lit_diffuse[c][k]);
        add(GLINT_PASS_GLOSSY_DIRECT, c, k, batch_.lit_specular[c][k]);
        add(GLINT_PASS_VOLUME_DIRECT, c, k, batch_.lit_volume[c][k]);
        continue;
      }
      if (queue.gathers() && queue.depth(k) == queue.past.bounced) {
        add(queue.past.in_medium ? GLINT_PASS_VOLUME_INDIRECT : GLINT_PASS_DIFFUSE_INDIRECT, c, k,
            s.total[c][k]);
        continue;
      }
      const int first =
          queue.transmitted(k) ? GLINT_PASS_TRANSMISSION_DIRECT : GLINT_PASS_GLOSSY_DIRECT;
      const int by_others = image_of(queue, k, first + 1);
      const bool is_made = queue.depth(k) == 1 || queue.past.reflections == 0;
      const double made = is_made ? s.emission[c][k] + s.environment[c][k] : 0;
      add(queue.depth(k) > 1                  ? first + 1
          : first == GLINT_PASS_GLOSSY_DIRECT ? other_gloss
                                              : first,
          c, k, made);
      add(by_others, c, k, s.total[c][k] - made);
    }
}

/// What surfaces and the surroundings give of themselves to the rays of the batch.
void Tracer::note_glow(const Queue& queue) {
  const SumColumns& s = batch_.sums;
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.material[k] < scene_.materials.size() && any(row(batch_.glow, k)))
      batch_.add_to_group(scene_.instances.group(batch_.instance[k]).light_group - 1, k,
                          row(batch_.glow, k));
    batch_.add_to_group(scene_.world.light_group, k, row(s.ambient, k) + row(s.environment, k));
  }
}

/// The batch's light of each group to the passes of the paths.
void Tracer::keep_groups(const Queue& queue) {
  double* const all = paths_.sums(film_, GLINT_PASS_LIGHT_GROUPS);
  for (size_t group = 0; group < batch_.group_count(); ++group)
    if (batch_.gives(group)) {
      double* const sums = all + 3 * group * paths_.stride();
      const double* const from[3] = {batch_.group(group)[0], batch_.group(group)[1],
                                     batch_.group(group)[2]};
      for (size_t c = 0; &queue == &first_ && c < 3; ++c)
        stages_.add(sums + c * paths_.stride(), from[c], queue.size());
      for (size_t k = 0; &queue != &first_ && k < queue.size(); ++k)
        for (size_t c = 0; c < 3; ++c) sums[c * paths_.stride() + queue.slot(k)] += from[c][k];
    }
}

/// Rays that bounced show what lights throw on surfaces, and nothing that these give of themselves.
void Tracer::clear_own_light(const Queue& queue) {
  for (double* const* sums :
       {batch_.sums.total, batch_.sums.ambient, batch_.sums.emission, batch_.sums.environment})
    for (size_t c = 0; sums[0] && c < 3; ++c) std::fill_n(sums[c], queue.size(), 0.0);
}

/// The batch's light to the parts of the picture: that of surfaces that camera rays meet.
void Tracer::keep_gathered(const Queue& queue) {
  for (const bool seen : {true, false}) {
    double* const sums = paths_.sums(film_, seen ? GLINT_PASS_DIFFUSE : GLINT_PASS_MIRROR);
    for (size_t c = 0; sums && c < 3; ++c)
      for (size_t k = 0; k < queue.size(); ++k)
        if ((queue.depth(k) == queue.past.bounced) == seen)
          sums[c * paths_.stride() + queue.slot(k)] += batch_.sums.total[c][k];
  }
}

}  // namespace glint

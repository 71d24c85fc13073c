# %% [markdown]
# # Figure 11: GAN training
#
# **What the paper says** (section 2.3): two phases an iteration. The discriminator learns from 200 real rows tagged 1.0 and 200
# generated rows tagged 0.0. Then its weights are frozen, "the tags for this pass are reversed, and the discriminator is 'told' that the
# generated values are real"; only the generator moves.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import COARSE, GENERATED
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, show

experiment = open_experiment()
claim("C4", "C5")

# %%
numbers = show(experiment, "fig11_gan_training")

# %% [markdown]
# *What to see:* in each phase exactly one box learns, and the error of the second phase travels *through* the box that does not.

# %%
print({name: int(value) for name, value in numbers.items()})
assert numbers["batch_size"] == 200 and numbers["latent"] == 16 and not numbers["mixed_batch"]

# %% [markdown]
# ## How it is built
#
# The step in the package reads like the figure, a comment for each arrow:

# %%
import inspect

from enhsim_tf import NoiseGAN

print(inspect.getsource(NoiseGAN.train_step))

# %% [markdown]
# "Frozen" is not a state of the discriminator here. It means that its weights are not in the list that the optimiser gets. Notebook 20
# shows what happens to those who rely on the state.
#
# To watch the phases one by one, take a small pair of networks and set one of the two learning rates to zero:

# %%
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.generator import build_generator

noise = experiment.data.noise_windows("train", 500, "notebook")[:, :100]
rows = noise[:, :, None].astype("float32")
gan = NoiseGAN(
    build_generator(100, seed=0), build_discriminator(100, filters=32, seed=0), batch_size=50, seed=0
)
networks = {"discriminator": gan.discriminator, "generator": gan.generator}
optimisers = {"discriminator": gan.discriminator_optimizer, "generator": gan.generator_optimizer}

# %%
moved = {}
for phase in networks:
    for name, optimiser in optimisers.items():
        optimiser.learning_rate = 0.001 if name == phase else 0.0
    before = {name: [w.numpy().copy() for w in model.trainable_variables] for name, model in networks.items()}
    gan.train_step(rows)
    for name, model in networks.items():
        after = model.trainable_variables
        moved[phase, name] = [float(np.abs(w.numpy() - old).max()) for w, old in zip(after, before[name])]

# %%
for (phase, name), by in moved.items():
    print(f"the {phase:13} learns: {sum(m > 0 for m in by)} of {len(by)} weights of the {name} move")
for phase in networks:
    for name in networks:
        assert all(m > 0 for m in moved[phase, name]) if name == phase else not any(moved[phase, name])

# %% [markdown]
# ## Exercises
#
# 1. Instead of reversing the tags one could let the generator *maximise* the discriminator's loss. Compare how strongly either pulls at
#    the generator while the discriminator is still sure of itself.
# 2. "It then trains on the entire batch" could also mean *one* update on 400 mixed rows instead of two on 200 each. Train the small
#    pair both ways (`mixed_batch`) for 200 iterations and compare accuracies.

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
judged = np.linspace(0.001, 0.999, 500)  # how real the discriminator finds a generated row
alt = "Pull on the generator by the discriminator's judgement, for both losses"
with drawing(alt, height=1.8) as panel:
    panel.plot(judged, 1 - judged, color=GENERATED, label="tags reversed: minimise −log D")
    panel.plot(judged, judged, color=COARSE, label="loss maximised: minimise log(1 − D)")
    panel.set(xlabel="judged real (D)", ylabel="pull (slope in D's logit)", xlim=(0, 1), ylim=(0, 1.05))
    panel.legend(frameon=False)

# %%
for mixed in (False, True):
    pair = build_generator(100, seed=0), build_discriminator(100, filters=32, seed=0)
    history = NoiseGAN(*pair, batch_size=50, mixed_batch=mixed, seed=0).fit(
        noise, num_iterations=200, record_every=50, verbose=False
    )
    accuracy = (history["accuracy_real"] + history["accuracy_generated"]) / 2
    print("one mixed update " if mixed else "two updates      ", np.round(accuracy, 2))

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. Early in training the discriminator is sure: D is near 0 on generated rows. There the maximised loss is flat and teaches nothing,
#    while the reversed tags pull with full strength. Both have their optimum in the same place.
# 2. Two updates take two steps of Adam for one, so the discriminator learns faster; for the rest the curves tell the same story. The
#    setting is `adversarial.mixed_batch`; the paper's text leaves it open, and the author's public code takes two.
#
# </details>

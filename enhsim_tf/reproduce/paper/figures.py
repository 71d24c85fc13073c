"""The figures of the paper by name, with their number, caption, text alternative and drawing function.

`figure_data` makes the arrays; `curves` and `diagrams` draw them. Drawing depends on the arrays only. It trains, saves and
displays nothing, and needs neither TensorFlow nor a screen.
"""

from enhsim_tf.reproduce.figure import Figure, _shape
from enhsim_tf.reproduce.paper import diagrams, plots

FIGURES: dict[str, Figure] = {
    "fig01_pipeline": Figure(
        1,
        "Enhanced simulation pipeline",
        "Diagram of nine numbered steps. A light simulator (1) makes approximate, quantised data (2), which a trained enhancer (3) turns into "
        "clean data (5). Telemetry from a real source (4) in the store, the goal, trains the enhancer; less its moving average it is the "
        "environmental noise (6) that trains a GAN (8), which turns random numbers of a latent space (7) into generated noise (9). Clean data "
        "and generated noise add up to the combined output, drawn beside real telemetry of the same times.",
        diagrams.pipeline,
    ),
    "fig02_source_target": Figure(
        2,
        "Training source and target time series",
        "Training windows in two rows: above the coarse simulation, a sum of square waves; below the telemetry of the same times.",
        plots.source_target,
    ),
    "fig03_enhancer": Figure(
        3,
        "Enhancing MLP neural network",
        "Table of the enhancer's layers with their output shapes and numbers of parameters, and the total.",
        lambda data: diagrams.layer_table(data, f"{int(data['total']) / 1e6:.1f} million parameters enhance a window"),
    ),
    "fig04_enhanced_simulation": Figure(
        4,
        "Enhanced simulation",
        "One held-out window: the stepped coarse simulation, the enhanced signal and the signal it should follow; below, the difference of the "
        "last two. The title and the line under it give the errors.",
        plots.enhanced_simulation,
    ),
    "fig05_real_or_generated": Figure(
        5,
        "Real or generated: windows of telemetry (counterpart of a borrowed picture)",
        "Real and generated windows of telemetry in random order, lettered, to be told apart; the answer stands upside down at the foot.",
        plots.real_or_generated,
    ),
    "fig06_real_or_generated_noise": Figure(
        6,
        "Real or generated: windows of noise (counterpart of a borrowed picture)",
        "Real and generated windows of noise in random order, lettered, to be told apart; the answer stands upside down at the foot. The line "
        "under the title gives the effective rank of generated and of real noise.",
        plots.real_or_generated_noise,
    ),
    "fig07_real_or_generated_series": Figure(
        7,
        "Real or generated: long stretches of telemetry (counterpart of a borrowed picture)",
        "Long stretches of telemetry, held-out real and generated ones in random order, lettered, to be told apart; the answer stands upside "
        "down at the foot.",
        plots.real_or_generated_series,
    ),
    "fig08_source_noise": Figure(
        8,
        "Extracted source noise",
        "Above, a window of telemetry with its centred moving average; below, the difference of the two, which is the noise, with lines at one "
        "standard deviation. The title gives the standard deviation.",
        plots.source_noise,
    ),
    "fig09_generator": Figure(
        9,
        "Generator construction",
        "Table of the generator's layers with their output shapes and numbers of parameters, and the total.",
        lambda data: diagrams.layer_table(
            data, f"{_shape(data['input_shape'])} numbers become {_shape(data['output_shape'][-1])} samples of noise"
        ),
    ),
    "fig10_discriminator": Figure(
        10,
        "Discriminator construction",
        "Table of the discriminator's layers with their output shapes and numbers of parameters, and the total.",
        lambda data: diagrams.layer_table(data, f"{_shape(data['input_shape'])} samples of noise become one judgement"),
    ),
    "fig11_gan_training": Figure(
        11,
        "GAN training",
        "Diagram of the two phases of an iteration. First the discriminator learns alone: real noise, tagged 1, and noise from the frozen "
        "generator, tagged 0, go in, and the loss moves the discriminator's weights only. Then the generator learns: its noise goes through the "
        "frozen discriminator with the tag reversed to 1, and the loss moves the generator's weights only.",
        diagrams.gan_training,
    ),
    "fig12_accuracy_loss": Figure(
        12,
        "Accuracy and loss for real and fake classifications",
        "Two panels over the iterations of training: the discriminator's accuracy and its loss, each for real and for generated noise, with a "
        "line at chance. The title gives the last accuracies.",
        plots.accuracy_loss,
    ),
    "fig13_combined": Figure(
        13,
        "Simulator output, enhanced, with noise added",
        "One held-out window in three panels: the coarse simulation with the enhanced signal; the enhanced signal with generated noise added; "
        "real telemetry of the same times. The line under the title gives the standard deviation of the first differences of each.",
        plots.combined,
    ),
    "fig14_telemetry_store": Figure(
        14,
        "Example telemetry signals in the store",
        "The beginning of the stored telemetry series over its timestamps.",
        plots.telemetry_store,
    ),
}

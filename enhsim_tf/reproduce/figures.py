"""tmp"""
import dataclasses
from enhsim_tf.reproduce import diagrams
import matplotlib.style
from pathlib import Path
STYLE=Path(__file__).with_name("style.mplstyle")
FIGURES={"fig01_pipeline": diagrams.pipeline, "fig03_enhancer": lambda d: diagrams.layer_table(d,"Enhancer: 13,697,400 parameters in four layers"),"fig09_generator": lambda d: diagrams.layer_table(d,"The generator spreads 16 numbers over 500"),"fig10_discriminator": lambda d: diagrams.layer_table(d,"The discriminator narrows 500 to one"), "fig11_gan_training": diagrams.gan_training}
def save(name,data,folder,caption,is_smoke,saved_as=("png","svg")):
    out=[]
    with matplotlib.style.context(["default", STYLE]):
        f=FIGURES[name](data)
        f.text(0.1/f.get_size_inches()[0],0.07/f.get_size_inches()[1],caption,size=7,color=diagrams.QUIET)
        for s in saved_as:
            p=folder/f"{name}.{s}"; f.savefig(p); out.append(p)
    return out

"""Continuous-time optimum of the swing-up of thesis A.2: direct collocation in CasADi, solved by IPOPT, from random starts.

The literal in optimal_motions/table_a_1.rs: 380.256269 (CasADi 3.8.2).
"""
import casadi as ca, numpy as np, sys
M,m,l,g,T=2.,1.,1.,9.81,2.
def run(K,d,seed):
    tau=np.append(0,ca.collocation_points(d,'radau'))
    C=np.zeros((d+1,d+1));B=np.zeros(d+1)
    for j in range(d+1):
        p=np.poly1d([1.])
        for r in range(d+1):
            if r!=j: p*=np.poly1d([1,-tau[r]])/(tau[j]-tau[r])
        dp=np.polyder(p)
        C[j]=[np.polyval(dp,t) for t in tau]; B[j]=np.polyval(np.polyint(p),1.)
    h=T/K; rng=np.random.default_rng(seed)
    def f(x,u):
        th,r,w,v=x[0],x[1],x[2],x[3]
        a=(u*ca.cos(th)+g*ca.sin(th))/l
        F=(M+m)*u-m*l*(a*ca.cos(th)-w*w*ca.sin(th))
        return ca.vertcat(w,v,a,u),.5*F*F
    W=[];w0=[];G=[];J=0
    x=ca.MX.sym('x0',4);W.append(x);s=np.array([np.pi,-1,0,0]);w0+=list(s);G.append(x-s)
    amp=rng.normal(size=3)*8; ph=rng.uniform(0,6,3)
    for k in range(K):
        X=[x]; 
        U=[ca.MX.sym('u',1) for _ in range(d)]
        for j in range(d):
            xj=ca.MX.sym('x',4);W+= [xj,U[j]];X.append(xj)
            t=(k+tau[j+1])/K
            w0+=[np.pi*(1-t),-1+t,0,0,sum(amp*np.sin(ph+np.arange(1,4)*2*np.pi*t))]
        for j in range(1,d+1):
            xp=sum(C[r][j]*X[r] for r in range(d+1))
            fj,L=f(X[j],U[j-1]); G.append(h*fj-xp); J+=B[j]*h*L
        x=X[-1]
    e=x; J+= .5e5*ca.dot(e,e)
    nlp={'x':ca.vertcat(*W),'f':J,'g':ca.vertcat(*G)}
    S=ca.nlpsol('S','ipopt',nlp,{'print_time':0,'ipopt':{'print_level':0,'max_iter':500,'tol':1e-10}})
    r=S(x0=w0,lbg=0,ubg=0); return float(r['f']),S.stats()['success']
best=(1e9,0)
for s in range(12):
    c,ok=run(30,4,s)
    if ok and c<best[0]-1e-7: best=(c,s)
print('K=30',best,flush=True)
for K in (40,60): print(K,run(K,5,best[1]),flush=True)
